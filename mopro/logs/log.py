"""A log in memory: columns with units and clocks, and the decisions made in reading it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.ledger import Rows
from mopro.logs.place import LogSource, cell_span

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Decision:
    """Something that a log does not state in so many words: what, taken as what, and why.

    `check` asks the reader to confirm it, `lasting` has each later command ask again.
    """

    subject: str
    taken_as: str
    reason: str
    check: bool = False
    lasting: bool = False

    def __str__(self) -> str:
        return f"{self.subject}: {self.taken_as} ({self.reason})"


@dataclass(frozen=True)
class Column:
    """One column of numbers: `raw` is its heading, `name` that without the unit.

    `unit` is a word of units.py as a column's suffix writes it (`mm`, `m_s`), None where the log
    states none. `values` (n) are NaN where the log has no reading. `clock` is the name of the
    column of its times, `nth` its place in a row.
    """

    raw: str
    name: str
    unit: str | None
    values: Floats
    clock: str
    nth: int = 0

    @property
    def present(self) -> NDArray[np.intp]:
        """Indices of the rows that have a reading."""
        return np.flatnonzero(~np.isnan(self.values))


@dataclass(frozen=True)
class Log:
    """The columns of one file. `clocks` are times in s from the first stamp, by name.

    `origins` are the first stamps in s (since 1970 where the log has dates). `lines` gives the
    number of a row's line: `first_line` + row unless the file has blank lines. `rows` is the
    ledger of the file's rows.

    A file of several recordings has them one after the other: on each clock they begin at the
    rows `starts`, with the first stamps `begins`, and the times go on from one to the next.
    """

    source: LogSource
    columns: tuple[Column, ...]
    clocks: dict[str, Floats]
    origins: dict[str, float]
    decisions: tuple[Decision, ...]
    first_line: int = 1
    lines: NDArray[np.int64] | None = None
    delimiter: str = ","
    texts: tuple[str, ...] = field(default=())
    rows: Rows = field(default=Rows(0))
    starts: dict[str, tuple[int, ...]] = field(default_factory=dict)
    begins: dict[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def recordings(self) -> int:
        """The number of recordings in the file."""
        return max((len(own) for own in self.starts.values()), default=1)

    def recording(self, nth: int) -> Log:
        """One of the recordings, from 0, as a log of its own with the columns that it has."""
        if self.recordings == 1:
            return self
        parts = {name: self._part(name, nth) for name in self.clocks}
        columns = [replace(c, values=c.values[parts[c.clock]]) for c in self.columns]
        clocks = {name: self.clocks[name][part] for name, part in parts.items()}
        clocks = {name: own - own[:1] for name, own in clocks.items()}
        part = parts[next(iter(parts))]
        lines = np.array([self.line_of(row) for row in range(part.start, part.stop)], np.int64)
        return replace(
            self,
            columns=tuple(c for c in columns if len(c.present)),
            clocks=clocks,
            origins={name: self.begins[name][nth] for name in clocks},
            lines=lines,
            starts={},
            begins={},
        )

    def _part(self, name: str, nth: int) -> slice:
        """The rows of a recording on the clock `name`."""
        edges = (*self.starts[name], len(self.clocks[name]))
        return slice(edges[nth], edges[nth + 1])

    def line_of(self, row: int) -> int:
        return self.first_line + row if self.lines is None else int(self.lines[row])

    def time_of(self, column: Column) -> Floats:
        """Times (s) of the rows of `column`."""
        return self.clocks[column.clock]

    def refuse(
        self, rule: str, message: str, row: int, nth: int, hint: str | None = None
    ) -> DataFileError:
        """The error about one cell."""
        line = self.line_of(row)
        span = cell_span(self.source.line(line), line, nth, self.delimiter)
        return DataFileError(self.source, [Diagnostic(rule, message, span, hint=hint)])


def listed(names: Sequence[str]) -> str:
    """`a, b, c` of at most a dozen names."""
    shown = ", ".join(names[:12])
    return shown if len(names) <= 12 else f"{shown} and {len(names) - 12} more"
