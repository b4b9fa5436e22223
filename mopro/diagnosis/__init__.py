"""Where a model and data disagree, which effect is missing, and how sure that is.

Stands alone: it takes any callable model and any effects.
"""

from mopro.diagnosis.engine import reconcile
from mopro.diagnosis.model import Candidate, Parameter, Series, Settings, Simulate
from mopro.diagnosis.verdict import Estimate, Gap, Named, Verdict, Where

__all__ = [
    "Candidate",
    "Estimate",
    "Gap",
    "Named",
    "Parameter",
    "Series",
    "Settings",
    "Simulate",
    "Verdict",
    "Where",
    "reconcile",
]
