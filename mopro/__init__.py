"""mopro: the MoPro motion-control language, compiled, emulated and checked."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mopro.diagnosis import reconcile
    from mopro.emulator import emulate
    from mopro.program.compile import compile  # noqa: A004
    from mopro.recording import Recording, read

# Each name comes with what it needs when it is first used: a text tool loads no numpy.
_HOMES = {
    "compile": "mopro.program.compile",
    "emulate": "mopro.emulator",
    "reconcile": "mopro.diagnosis",
    "Recording": "mopro.recording",
    "read": "mopro.recording",
}

__all__ = ["Recording", "compile", "emulate", "read", "reconcile"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mopro' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
