"""A recording in memory."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.recording.run import Run, outcome

if TYPE_CHECKING:
    import pandas as pd

    from mopro.recording.shown_figure import ShownFigure

Columns = dict[str, NDArray[Any]]

# The name under which a file keeps the header of a recording.
KEY = "mopro"
CSV_MARK = "# mopro "
TIME = "time_s"
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


class UnknownColumn(KeyError):
    """A name that is no column of a recording; its words name the nearest column, and all."""

    def __init__(self, name: object, columns: Iterable[str]) -> None:
        super().__init__(name)
        self._name, self._columns = name, list(columns)

    def __str__(self) -> str:
        near = get_close_matches(str(self._name), self._columns, n=1)
        hint = f": did you mean {near[0]!r}?" if near else "."
        return f"there is no column {self._name!r}{hint} There are {', '.join(self._columns)}"


class Sink(Protocol):
    """Receives a recording in chunks; each chunk has the same columns, of equal length."""

    def write(self, columns: Columns) -> None: ...


@dataclass(frozen=True)
class ChosenColumns:
    """A sink that hands on to another `time_s` and the columns that its `patterns` name.

    A pattern is a name, or one with `*` and `?`. Raises UnknownColumn for one that names none.
    """

    sink: Sink
    patterns: Sequence[str]

    def write(self, columns: Columns) -> None:
        named = {TIME}
        for pattern in self.patterns:
            found = fnmatch.filter(columns, pattern)
            if not found:
                raise UnknownColumn(pattern, columns)
            named.update(found)
        self.sink.write({name: values for name, values in columns.items() if name in named})


class FileSink(Sink, Protocol):
    """A sink that becomes a file under `header`, with the story of the `run`.

    Both may be replaced until it closes.
    """

    header: Header
    run: Run | None


@dataclass(frozen=True)
class Recording:
    """Columns of equal length with a header.

    `run` tells how the moves went; None if the file does not hold it.
    """

    header: Header
    columns: Columns = field(repr=False)
    run: Run | None = field(default=None, compare=False)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """The values of `column`; UnknownColumn, a KeyError, if there is none of this name."""
        try:
            return self.columns[column]
        except (KeyError, TypeError):
            raise UnknownColumn(column, self.columns) from None

    def _repr_html_(self) -> str:
        """Outcome, moves and columns."""
        from mopro import markup
        from mopro.recording.moves import folded, folded_columns

        header, run = self.header, self.run
        effects = ", ".join(str(effect.get("name")) for effect in header.effects) or "none"
        parts = [
            f"{len(self)} samples at {header.rate_hz:g} Hz by the {header.back_end}; payload "
            f"{header.payload_kg:g} kg; effects switched on: {effects}.",
            f"Columns: {', '.join(self.columns)}. plot() draws them.",
        ]
        shown = list(map(markup.paragraph, parts))
        if run is not None:
            unit = run.moves[0].unit if run.moves else ""
            rows = (repeated.cells for repeated in folded(run.moves))
            moves = markup.table(folded_columns(unit), rows, most=markup.MOST_ROWS)
            shown[1:1] = [markup.paragraph(outcome(run)), moves]
        return markup.fragment(f"{header.program} on {header.machine}", shown)

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

    def plot(self, unit: str | None = None) -> ShownFigure:
        """Figure of position, speed, lag, stall margin, force, phase currents and temperature.

        Lengths are in `unit` (in, mm, cm, m, um), or that of the program, or mm; what the
        recording does not hold is not drawn. Raises ValueError for another unit.
        """
        from mopro.recording.envelope import Envelopes
        from mopro.recording.figure import draw

        title = f"{self.header.program} on {self.header.machine}"
        return draw(Envelopes.of(self.columns), title, self.run, unit)


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
