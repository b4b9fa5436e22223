"""The engine of the diagnosis: which effects of a catalogue a model lacks, by the evidence in data.

For readings y of sensors, a model f, the numbers θ of a set S of effects and nuisances N c such as
offsets,

    y = f(θ) + N c + noise,

`reconcile` finds the S that the data call for, with the sizes and their intervals, or says that
something is left which no effect explains:

    residuals → signatures → subsets → fits → free-form terms → doubts → alternatives → remainder

It takes any callable model, any effects and any data, and imports numpy, scipy and no other room of
mopro. `Candidate` and `Parameter` state an effect, `Series` the readings of a sensor in a run.
`PASSES` are the steps between question and verdict; `reconcile(passes=...)` takes others. The
verdict keeps a trace of what each of them did.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mopro.engine.candidate import Candidate, Parameter, ResidualView, Role
from mopro.engine.series import Series, Settings, Simulate
from mopro.engine.tolerances import Tolerances

if TYPE_CHECKING:
    from mopro.engine.diagnosis import reconcile
    from mopro.engine.passes import PASSES, a_pass, until_stable, where
    from mopro.engine.state import State
    from mopro.engine.verdict import Estimate, Gap, Named, Taken, Verdict, Where

# These come with what they need when they are first used: a run of the emulator loads no scipy.
_HOMES = {
    **dict.fromkeys(("Estimate", "Gap", "Named", "Taken", "Verdict", "Where"), "verdict"),
    **dict.fromkeys(("PASSES", "a_pass", "until_stable", "where"), "passes"),
    "State": "state",
    "reconcile": "diagnosis",
}

__all__ = [
    "PASSES",
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
    "State",
    "Taken",
    "Tolerances",
    "Verdict",
    "Where",
    "a_pass",
    "reconcile",
    "until_stable",
    "where",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
