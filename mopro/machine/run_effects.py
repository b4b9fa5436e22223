"""Effects that belong to certain runs: the key `runs` in a machine file of any kind.

It names the data files of the runs that an effect was fitted on, each with its checksum. In any
other run, and in a simulation, which has no data, the effect is off.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Protocol

from mopro.tomlfile import Value
from mopro.tomlfile.schema import number_in

RUNS = "runs"
# A run's data file as its experiment names it, and the CRC-32 of its bytes in hexadecimal.
Data = tuple[str, str]
NO_DATA: Data = ("", "")
_CHECKSUM = re.compile(r"[0-9a-fA-F]{8}")
_FORM = f'expected {RUNS} = {{ "run.csv" = "1c291ca3" }}: data files and the CRC-32 of each'


class _Run(Protocol):
    @property
    def name(self) -> str:
        """Its name in the experiment."""
        ...

    @property
    def data(self) -> Data:
        """Its data file."""
        ...


def data_of(path: Path, stated: str) -> Data:
    """The data file `path`, which the experiment calls `stated`."""
    return Path(stated).as_posix(), f"{zlib.crc32(path.read_bytes()):08x}"


# -- the key -----------------------------------------------------------------------------


def states_runs(value: Value) -> bool:
    """True for `runs` of an effect, which is a parameter if it is a number or has a value."""
    number = value.data.get("value") if isinstance(value.data, dict) else value.data
    return value.key == RUNS and number_in(number) is None


def read_runs(value: Value) -> dict[str, str]:
    """Names of data files, and their checksums; a fault is noted at its place."""
    if not isinstance(value.data, dict) or not value.data:
        raise value.refused(_FORM)
    return {file: _checksum(value[file]) for file in value.data}


def _checksum(value: Value) -> str:
    if not isinstance(value.data, str) or not _CHECKSUM.fullmatch(value.data):
        raise value.refused(f"{_FORM}, eight hexadecimal digits")
    return value.data.lower()


# -- runs of an experiment ----------------------------------------------------------------


def nth_of(data: Data, runs: Mapping[str, str]) -> int | None:
    """Place (from 0) of a run's data among `runs`, with their content as it was; None if not.

    In whatever folder: the data may have been copied.
    """
    own = _name(data[0]), data[1]
    files = [(_name(file), checksum) for file, checksum in runs.items()]
    return files.index(own) if own in files else None


def files_of(runs: Sequence[_Run]) -> dict[str, str]:
    """The data files of these runs, as an effect's `runs` names them.

    Files of one name in several folders have their folders with them.
    """
    files = dict(run.data for run in runs)
    shared = Counter(map(_name, files))
    return {
        _name(file) if shared[_name(file)] == 1 else file: checksum
        for file, checksum in files.items()
    }


def others(runs: Mapping[str, str], trials: Sequence[_Run]) -> list[_Run]:
    """Those of `trials` that are none of `runs`."""
    return [trial for trial in trials if nth_of(trial.data, runs) is None]


def known_absent(
    effects: Mapping[str, Mapping[str, str]], trials: Sequence[_Run]
) -> list[frozenset[str]]:
    """Those of `effects` that are off in each of `trials`, as they belong to others of them."""
    absent = {name: others(runs, trials) for name, runs in effects.items()}
    here = [name for name, own in absent.items() if len(own) < len(trials)]
    return [frozenset(name for name in here if trial in absent[name]) for trial in trials]


def absence_notes(
    machine: str, effects: Mapping[str, Mapping[str, str]], trials: Sequence[_Run] = ()
) -> Iterator[str]:
    """A line for each effect that is off in some of `trials`; for each if there are none.

    `effects`: those of `machine` that belong to certain runs, each with these.
    """
    for name, runs in effects.items():
        absent = others(runs, trials)
        here = {_name(trial.data[0]) for trial in absent}
        files = ", ".join(f"another {own}" if _name(own) in here else own for own in runs)
        names = ", ".join(own.name for own in absent)
        where = "here" if len(absent) == len(trials) else f"in {names}"
        if absent or not trials:
            yield f"{name} of {machine} is left out {where}: it belongs to {files}"


def _name(file: str) -> str:
    return PurePosixPath(file).name
