"""numba, with memory made sure of: LLVM aborts the process where it gets none.

Importing this costs what numba costs. Whoever compiles with numba imports it: from then on each
compilation in the process, and each use of a kept one, raises MemoryError beforehand.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock

from mopro.process.loading import make_sure

# Bytes of address space: twice what LLVM takes for the kernel of a machine without effects. Halved,
# LLVM may abort; doubled, more compilations that had enough are refused.
_TO_COMPILE = 64 << 20

# Untyped in numba.
njit: Callable[..., Any] = numba.njit
_register: Callable[[str, event.Listener], None] = event.register
_is_locked: Callable[[], bool] = global_compiler_lock.is_locked


class _MakesSure(event.Listener):
    """Listener to numba's lock, which is taken for each compilation and again within it."""

    def on_start(self, event: object) -> None:
        if not _is_locked():
            make_sure(_TO_COMPILE)

    def on_end(self, event: object) -> None:
        pass


_register("numba:compiler_lock", _MakesSure())
