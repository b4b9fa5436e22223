"""Data sets of HDF5 files, read by a process of their own.

The library is C that a damaged file can crash, or keep busy for ever; a process can be ended.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.process.jobs import run_module

if sys.platform != "win32":
    import resource

# Processor time that a file may take, and more for each MB of it: a choice, far above what whole
# files take. A damaged one may take for ever.
LEAST_S, S_PER_MB = 5.0, 1.0
_WORDS = "units.json"
_LONGEST_UNIT = 60
_TOO_LONG = "it was not read in {:.0f} s: is it damaged?"

Arrays = dict[str, NDArray[Any]]


def arrays_of(path: Path, check: Callable[[int, int], None]) -> tuple[Arrays, dict[str, str]]:
    """The one-dimensional data sets of numbers by their full names, and the units they state.

    `check` is told the rows of each and the number of columns, and raises where they are too many.
    ValueError for a file that the library cannot read, or not within LEAST_S and S_PER_MB.
    """
    most_s = LEAST_S + S_PER_MB * path.stat().st_size / 1e6
    with TemporaryDirectory() as made:
        folder = Path(made)
        try:
            done = run_module("mopro.logs.hdf5", [str(path), made, f"{most_s:.0f}"], 10 * most_s)
        except subprocess.TimeoutExpired as error:
            raise ValueError(_TOO_LONG.format(10 * most_s)) from error
        if sys.platform != "win32" and done.returncode == -signal.SIGXCPU:
            raise ValueError(_TOO_LONG.format(most_s))
        if done.returncode:
            said = done.stderr.decode("utf-8", "replace").strip().splitlines()
            raise ValueError(said[-1] if said else f"the library ended with {done.returncode}")
        stated = json.loads((folder / _WORDS).read_text("utf-8"))
        arrays: Arrays = {}
        for number, name in enumerate(stated["names"]):
            check(stated["rows"][number], number + 1)
            arrays[name] = np.load(folder / f"{number}.npy", allow_pickle=False)
        return arrays, stated["units"]


def _copy(path: str, folder: Path) -> None:
    """Write what `path` holds as arrays that numpy reads, up to the bounds of a log."""
    import h5py

    from mopro.logs.log import MOST_ROWS

    names: list[str] = []
    rows: list[int] = []
    units: dict[str, str] = {}

    def take(key: str, item: Any) -> None:
        if not (isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind in "iuf"):
            return
        if item.shape[0] <= MOST_ROWS:
            np.save(folder / f"{len(names)}.npy", item[:])
        names.append(key)
        rows.append(item.shape[0])
        stated = item.attrs.get("unit", item.attrs.get("units"))
        if stated is not None:
            text = stated.decode("utf-8", "replace") if isinstance(stated, bytes) else str(stated)
            units[key] = text[:_LONGEST_UNIT]

    with h5py.File(path, "r") as file:
        file.visititems(take)
    words = json.dumps({"names": names, "rows": rows, "units": units})
    (folder / _WORDS).write_text(words, "utf-8")


def main() -> None:
    """Copy the file named first to the folder named second; what fails is said in a line.

    The third argument is the processor time (s) after which this process is ended, whatever becomes
    of the one that started it.
    """
    path, folder, most_s = sys.argv[1:]
    if sys.platform != "win32":
        resource.setrlimit(resource.RLIMIT_CPU, (int(most_s), int(most_s) + 1))
    try:
        _copy(path, Path(folder))
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError) as error:
        sys.exit(" ".join(str(error).split())[:200] or type(error).__name__)


if __name__ == "__main__":
    main()
