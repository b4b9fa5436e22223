"""Memory made sure of before work that ends or halts the process where it lacks any."""

from __future__ import annotations

import os
import sys
from importlib.machinery import ModuleSpec

# Bytes of address space that libraries map while they load. Where those are not to be had, LLVM
# aborts, and OpenBLAS tries again without end. It has a stack and a buffer for each processor.
# Halved, some limits end a command by a signal; doubled, more commands that had enough are refused.
_TO_LOAD = {
    "numpy": 128 << 20,
    "scipy.linalg": 160 << 20,
    "numba": 192 << 20,
    "pyarrow": 256 << 20,
    "matplotlib": 64 << 20,
    "pandas": 64 << 20,
}
_WITH_OPENBLAS = {"numpy", "scipy.linalg"}
_A_PROCESSOR = 40 << 20
_MOST_PROCESSORS = 64


def make_sure(size: int) -> None:
    """Return at once if `size` more bytes can be had now; else raise MemoryError."""
    import mmap

    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError from error


def make_sure_on_import() -> None:
    """Have the import of a large library raise MemoryError where it would not end in order."""
    if _Finder not in sys.meta_path:
        sys.meta_path.insert(0, _Finder)


class _Finder:
    """Finder of modules that finds none: it is asked first, before a module is loaded."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name in _TO_LOAD:
            further = min(os.cpu_count() or 1, _MOST_PROCESSORS) - 1
            threads = further * _A_PROCESSOR if name in _WITH_OPENBLAS else 0
            make_sure(_TO_LOAD[name] + threads)
        return None
