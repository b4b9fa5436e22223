"""Where a model and data disagree, which effect is missing, and how sure that is.

Stands alone: it takes any callable model and any effects.
"""

from mopro.diagnosis.engine import reconcile
from mopro.diagnosis.model import Candidate, Leftover, Parameter, Role, Series, Settings, Simulate
from mopro.diagnosis.verdict import Estimate, Gap, Named, Verdict, Where

__all__ = [
    "Candidate",
    "Estimate",
    "Gap",
    "Leftover",
    "Named",
    "Parameter",
    "Role",
    "Series",
    "Settings",
    "Simulate",
    "Verdict",
    "Where",
    "reconcile",
]
