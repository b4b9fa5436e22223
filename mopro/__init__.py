"""mopro: the MoPro motion-control language, compiled, emulated and checked.

`compile` or `compile_file` makes a `Program`, `emulate` a `Recording` of it, `read` one of a
file, and `sweep` a table of many runs; `open_experiment` compares measured data with a `Machine`,
and `reconcile` finds what any model lacks. Recordings, programs, machines, comparisons and
verdicts show themselves in a notebook.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mopro.emulator import emulate
    from mopro.engine import reconcile
    from mopro.engine.verdict import Verdict
    from mopro.experiment.comparison import Comparison
    from mopro.experiment.opened import open_experiment
    from mopro.machine import Machine, load_machine
    from mopro.program import Program
    from mopro.program.compile import compile, compile_file  # noqa: A004
    from mopro.recording import Recording, read
    from mopro.sweeps import sweep

# Each name comes with what it needs when it is first used: a text tool loads no numpy.
_HOMES = {
    "Comparison": "mopro.experiment.comparison",
    "Machine": "mopro.machine",
    "Program": "mopro.program",
    "Recording": "mopro.recording",
    "Verdict": "mopro.engine",
    "compile": "mopro.program.compile",
    "compile_file": "mopro.program.compile",
    "emulate": "mopro.emulator",
    "load_machine": "mopro.machine",
    "open_experiment": "mopro.experiment.opened",
    "read": "mopro.recording",
    "reconcile": "mopro.engine",
    "sweep": "mopro.sweeps",
}

__all__ = [
    "Comparison",
    "Machine",
    "Program",
    "Recording",
    "Verdict",
    "compile",
    "compile_file",
    "emulate",
    "load_machine",
    "open_experiment",
    "read",
    "reconcile",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        hint = f": its names are {', '.join(__all__)}" if name.islower() else ""
        raise AttributeError(f"module 'mopro' has no attribute '{name}'{hint}", name=name)
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
