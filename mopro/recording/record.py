"""A recording in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.recording.run import Run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Columns = dict[str, NDArray[Any]]

# The name under which a file keeps the header of a recording.
KEY = "mopro"
CSV_MARK = "# mopro "
INTEGER_COLUMNS = frozenset({"line"})
# Stalls that a header names; the list of a loop's could be longer than the recording.
_MOST_STALLS = 100

_AXIS_COLUMNS = (
    "command_{}_m",
    "position_{}_m",
    "velocity_{}_m_s",
    "phase_a_{}_A",
    "phase_b_{}_A",
    "force_{}_N",
)


def column_names(axes: Sequence[int]) -> list[str]:
    """All columns of an emulated recording of `axes`, in order.

    A controller's recording has those that can be seen over the link.
    """
    return ["time_s", *(c.format(n) for n in axes for c in _AXIS_COLUMNS), "temperature_C", "line"]


@dataclass(frozen=True)
class Header:
    """Origin of a recording, sufficient to make it again.

    `program_sha256` is the digest of the program file's bytes, `back_end` the emulator or
    controller, `effects` the effects switched on (name, axes and parameters of each).
    `clock` is the clock of the sample times: the machine's, or that of the polling host.
    `rate_hz` is the rate of the samples, a controller's their mean rate. After the run
    `duration_s` is how long the program took, beyond which the samples show the axes settle,
    and `stalls` are the first hundred `Stall`s.
    """

    program: str
    program_sha256: str
    machine: str
    back_end: str
    rate_hz: float
    payload_kg: float
    seed: int
    versions: Mapping[str, str]
    effects: list[dict[str, Any]] = field(default_factory=list)
    clock: str = "machine"
    duration_s: float | None = None
    stalls: list[dict[str, Any]] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    def after(self, run: Run) -> Header:
        """This header with what is known after `run`."""
        return replace(
            self,
            rate_hz=self.rate_hz if run.rate_hz is None else run.rate_hz,
            duration_s=run.duration_s,
            stalls=[asdict(stall) for stall in run.stalls[:_MOST_STALLS]],
        )


class Sink(Protocol):
    """Receives a recording in chunks; each chunk has the same columns, of equal length."""

    def write(self, columns: Columns) -> None: ...


class FileSink(Sink, Protocol):
    """A sink that becomes a file under `header`, which may be replaced until it closes."""

    header: Header


@dataclass(frozen=True)
class Recording:
    """Columns of equal length with a header; `run` is None for a recording from a file."""

    header: Header
    columns: Columns
    run: Run | None = field(default=None, compare=False)

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def axes(self) -> list[int]:
        """The axes with a command or a position, in order."""
        named = (c.split("_") for c in self.columns if c.startswith(("command_", "position_")))
        return sorted({int(parts[1]) for parts in named})

    def to_pandas(self) -> pd.DataFrame:
        """The columns as a data frame (needs the extra `mopro[pandas]`)."""
        import pandas as pd

        return pd.DataFrame(self.columns)

    def plot(self) -> Figure:
        """Figure of position, velocity, following error, force and temperature over time."""
        from mopro.recording.figure import draw

        return draw(self.columns, self.axes, f"{self.header.program} on {self.header.machine}")


class MemorySink:
    """Holds samples in memory; beyond `most` only every second, fourth, ... sample."""

    def __init__(self, most: int | None = None) -> None:
        self._most = most
        self._stride = 1
        self._seen = 0
        self._chunks: list[Columns] = []

    def write(self, columns: Columns) -> None:
        first = -self._seen % self._stride
        self._seen += len(columns["time_s"])
        self._chunks.append(_thinned(columns, first, self._stride))
        while self._most is not None and self._seen / self._stride > self._most:
            self._stride *= 2
            self._chunks = [_thinned(self._columns(), 0, 2)]

    def recording(self, header: Header, run: Run | None = None) -> Recording:
        header = header if run is None else header.after(run)
        return Recording(
            replace(header, rate_hz=header.rate_hz / self._stride), self._columns(), run
        )

    def _columns(self) -> Columns:
        names = self._chunks[0].keys()
        return {name: np.concatenate([chunk[name] for chunk in self._chunks]) for name in names}


def _thinned(columns: Columns, first: int, stride: int) -> Columns:
    return {name: values[first::stride] for name, values in columns.items()}
