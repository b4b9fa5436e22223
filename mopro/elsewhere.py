"""Libraries loaded outside of the current folder, where they would obey a stranger's settings."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import chdir
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

# The file that each looks for in the current folder while it loads.
_SETTINGS = {"matplotlib": "matplotlibrc", "numba": ".numba_config.yaml"}


def load_elsewhere() -> None:
    """Have these libraries load as if the current folder held no settings for them."""
    if _Finder not in sys.meta_path:
        sys.meta_path.insert(0, _Finder)


class _Finder:
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
