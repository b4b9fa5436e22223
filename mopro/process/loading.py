"""Libraries loaded in order: with memory made sure of, and outside of the current folder.

Memory is made sure of before work that ends or halts the process where it lacks any.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import chdir
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

# -- memory -----------------------------------------------------------------------------------
# Memory made sure of before work that ends or halts the process where it lacks any.


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
    if _MemoryFirst not in sys.meta_path:
        sys.meta_path.insert(0, _MemoryFirst)


class _MemoryFirst:
    """Finder of modules that finds none: it is asked first, before a module is loaded."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name in _TO_LOAD:
            further = min(os.cpu_count() or 1, _MOST_PROCESSORS) - 1
            threads = further * _A_PROCESSOR if name in _WITH_OPENBLAS else 0
            make_sure(_TO_LOAD[name] + threads)
        return None


# -- settings in the current folder -----------------------------------------------------------
# Libraries loaded outside of the current folder, where they would obey a stranger's settings.

# The file that each looks for in the current folder while it loads.
_SETTINGS = {"matplotlib": "matplotlibrc", "numba": ".numba_config.yaml"}


def load_elsewhere() -> None:
    """Have these libraries load as if the current folder held no settings for them."""
    if _Elsewhere not in sys.meta_path:
        sys.meta_path.insert(0, _Elsewhere)


class _Elsewhere:
    """Finder of these libraries, which are found as ever and loaded in mopro's own folder.

    The folder is changed for the whole process, so only where there is such a file.
    """

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in _SETTINGS:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader.exec_module = _loading(name, spec.loader.exec_module)  # type: ignore[assignment]
        return spec


def _loading(name: str, load: Callable[[ModuleType], None]) -> Callable[[ModuleType], None]:
    def load_away(module: ModuleType) -> None:
        if os.path.lexists(_SETTINGS[name]):
            with chdir(Path(__file__).parent):
                load(module)
        else:
            load(module)
        if name == "numba":
            # It looks for the file at each compilation again.
            module.core.config._config_fname = os.devnull

    return load_away
