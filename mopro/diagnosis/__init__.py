"""Diagnosis of a model: which effects of a catalogue it lacks, by the evidence in data.

Stands alone: it takes any callable model and any effects.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

# Each name comes with what it needs when it is first used: effects say how they are fitted in
# the words of `model`, and a run of the emulator loads no scipy.
_HOMES = {
    "Candidate": "model",
    "Estimate": "verdict",
    "Gap": "verdict",
    "ResidualView": "model",
    "Named": "verdict",
    "Parameter": "model",
    "Role": "model",
    "Series": "model",
    "Settings": "model",
    "Simulate": "model",
    "Verdict": "verdict",
    "Where": "verdict",
    "reconcile": "engine",
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
    "Verdict",
    "Where",
    "reconcile",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
