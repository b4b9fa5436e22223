"""Diagnosis of a model: which effects of a catalogue it lacks, by the evidence in data.

Stands alone: it takes any callable model and any effects.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mopro.engine.candidate import Candidate, Parameter, ResidualView, Role
from mopro.engine.series import Series, Settings, Simulate
from mopro.engine.tolerances import Tolerances

if TYPE_CHECKING:
    from mopro.engine.diagnosis import reconcile
    from mopro.engine.verdict import Estimate, Gap, Named, Verdict, Where

# These come with what they need when they are first used: a run of the emulator loads no scipy.
_HOMES = {
    **dict.fromkeys(("Estimate", "Gap", "Named", "Verdict", "Where"), "mopro.engine.verdict"),
    "reconcile": "mopro.engine.diagnosis",
}

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
    "Tolerances",
    "Verdict",
    "Where",
    "reconcile",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
