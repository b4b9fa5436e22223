"""Diagnosis of a model: which effects of a catalogue it lacks, by the evidence in data.

Stands alone: it takes any callable model and any effects.
"""

from mopro.diagnosis.engine import reconcile
from mopro.diagnosis.model import (
    Candidate,
    Parameter,
    ResidualView,
    Role,
    Series,
    Settings,
    Simulate,
)
from mopro.diagnosis.verdict import Estimate, Gap, Named, Verdict, Where

__all__ = [
    "Candidate",
    "Estimate",
    "Gap",
    "Named",
    "Parameter",
    "ResidualView",
    "Role",
    "Series",
    "Settings",
    "Simulate",
    "Verdict",
    "Where",
    "reconcile",
]
