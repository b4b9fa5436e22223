"""A log in memory: places, rows, columns with units and clocks, and the decisions of reading it."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataFileError, Diagnostic
from mopro.source import Source, Span

# -- places -----------------------------------------------------------------------------------
# Places of cells in a file that is not held in memory.


MOST_CHARACTERS = 10_000
_COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class LogSource(Source):
    """A log whose text is not held in memory; `line` reads the line that a message shows."""

    path: Path = field(default=Path())
    is_text: bool = True

    def line(self, number: int) -> str:
        if not self.is_text:
            return ""
        try:
            with open(self.path, encoding=self.encoding, errors="replace", newline=None) as file:
                return next(islice(_cut(file), number - 1, number), "").rstrip("\r\n")
        except OSError:
            return ""


def _cut(file: Iterator[str]) -> Iterator[str]:
    return (line[:MOST_CHARACTERS] for line in file)


def cell_span(text: str, line: int, nth: int, delimiter: str) -> Span:
    """Span of the `nth` cell of a line; the line's end for a cell that is not there."""
    starts = _starts(text, delimiter)
    if nth >= len(starts) - 1:
        return Span(line, len(text) + 1, len(text) + 2)
    start, end = starts[nth], starts[nth + 1] - 1
    lead = len(text[start:end]) - len(text[start:end].lstrip())
    return Span(line, start + lead + 1, max(end, start + lead + 1) + 1)


def _starts(text: str, delimiter: str) -> list[int]:
    """Start of each cell, and one past the line's end: delimiters in a quoted cell do not count."""
    starts, quoted = [0], False
    for index, character in enumerate(text):
        if character == '"':
            quoted ^= text[starts[-1] : index + 1].lstrip().startswith('"')
        if character == delimiter and not quoted:
            starts.append(index + 1)
    return [*starts, len(text) + 1]


def cells_of(text: str, delimiter: str) -> list[str]:
    """The cells of one line, without the blanks around them and without a mark of a comment."""
    if delimiter == " ":
        words = text.split()
        return words[1:] if words and words[0] in _COMMENTS else words
    try:
        row = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        row = text.split(delimiter)
    return [cell.strip() for cell in row]


# -- rows -------------------------------------------------------------------------------------
# The ledger of a log's rows: how many were read and used, and why the others were left out.

# Rows that may be left out without a check: this many, and this share of all.
_FEW = 5
_SMALL_SHARE = 0.01


@dataclass(frozen=True)
class Rows:
    """Rows that were `read`, and how many of them were left out, by reason; the rest is used.

    Raises ValueError if more are left out than were read.
    """

    read: int
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.used < 0 or any(count <= 0 for count in self.left_out.values()):
            raise ValueError(f"{self.read} rows cannot be without {dict(self.left_out)}")

    @property
    def lost(self) -> int:
        return sum(self.left_out.values())

    @property
    def used(self) -> int:
        return self.read - self.lost

    @property
    def to_check(self) -> bool:
        """True if more than a few rows, or more than 1 %, are left out."""
        return self.lost > min(_FEW, _SMALL_SHARE * self.read)

    def without(self, why: str, count: int) -> Rows:
        """The ledger after `count` further rows were left out."""
        if not count:
            return self
        return Rows(self.read, {**self.left_out, why: self.left_out.get(why, 0) + count})

    def __add__(self, other: Rows) -> Rows:
        """The ledger of both; reasons are counted together."""
        reasons = dict.fromkeys((*self.left_out, *other.left_out))
        both = {w: self.left_out.get(w, 0) + other.left_out.get(w, 0) for w in reasons}
        return Rows(self.read + other.read, both)

    def as_json(self) -> dict[str, Any]:
        left_out = [{"why": why, "count": count} for why, count in self.left_out.items()]
        return {"read": self.read, "used": self.used, "left_out": left_out}

    def __str__(self) -> str:
        reasons = ", ".join(f"{count} {why}" for why, count in self.left_out.items())
        counts = f"{self.read} read, {self.used} used"
        return f"{counts}, {self.lost} left out: {reasons}" if reasons else f"{counts}"


# -- the log ----------------------------------------------------------------------------------
# A log in memory: columns with units and clocks, and the decisions made in reading it.

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
    column of its times.
    """

    raw: str
    name: str
    unit: str | None
    values: Floats
    clock: str

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


# -- a table on the way -----------------------------------------------------------------------
# Cells of a log as columns of numbers or words, whatever the file's format.

MOST_ROWS = 20_000_000


@dataclass(frozen=True)
class Table:
    """Columns of one length: floats, integers (of stamps) or Arrow arrays of words, in order.

    `units` holds what the file states apart from the headings, `left_out` the number of rows of the
    file that are not in the columns, by reason.
    """

    source: LogSource
    columns: dict[str, NDArray[Any] | Any]
    units: dict[str, str]
    decisions: tuple[Decision, ...]
    header_line: int = 1
    first_line: int = 1
    lines: NDArray[np.int64] | None = None
    delimiter: str = ","
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())))
