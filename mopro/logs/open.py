"""Opens a log: its table, its clocks, its columns with names and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError, DataFileError
from mopro.inputs import open_to_read
from mopro.logs.clock import Clock, clock_columns, clock_of
from mopro.logs.containers import READERS
from mopro.logs.log import Column, Decision, Floats, Log, listed
from mopro.logs.names import heading
from mopro.logs.stamps import NoStamp
from mopro.logs.table import Table
from mopro.logs.text import read_text

ROW_CLOCK = "row"


@dataclass(frozen=True)
class Asked:
    """Facts about a log that the caller states: column and unit of the times, or the rate instead.

    `missing` are words that stand for a missing reading.
    """

    time: str | None = None
    time_unit: str | None = None
    rate_hz: float | None = None
    missing: tuple[str, ...] = ()


def read_log(path: Path, asked: Asked | None = None) -> Log:
    """The log in file `path`.

    Raises DataError (unreadable, beyond the bounds, no times) and DataFileError with the line and
    column of each bad cell.
    """
    asked = asked or Asked()
    table = _table(path, asked)
    clocks = _clocks(table, asked)
    return _log(table, clocks)


def _table(path: Path, asked: Asked) -> Table:
    reader = READERS.get(path.suffix.lower())
    try:
        open_to_read(path).close()
        return reader(path, str(path)) if reader else read_text(path, str(path), asked.missing)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{path}: cannot be read: {reason}", "unreadable") from error


def _clocks(table: Table, asked: Asked) -> list[Clock]:
    if asked.rate_hz is not None:
        return [_row_clock(table, asked.rate_hz)]
    names = clock_columns(table)
    if asked.time is not None:
        if asked.time not in table.columns:
            known = listed(list(table.columns))
            message = f"{table.source.name}: there is no column {asked.time}; there are {known}"
            raise DataError(message, "missing-column")
        names = [asked.time]
    if not names:
        known = listed(list(table.columns))
        message = f"{table.source.name}: no column of times was found among {known}"
        hint = "say which it is with --time COLUMN, or how fast the rows follow with --rate HZ"
        raise DataError(f"{message}; {hint}", "which-time")
    return [_clock(table, name, asked.time_unit) for name in names]


def _clock(table: Table, name: str, unit: str | None) -> Clock:
    try:
        clock = clock_of(table, name, unit)
    except NoStamp as error:
        empty = _log(table, [])
        nth = list(table.columns).index(name)
        raise empty.refuse("clock", f"{name}: {error}", error.row, nth) from error
    if len(clock.order) < 2:
        message = f"{table.source.name}: column {name} has fewer than two times"
        raise DataError(message, "clock")
    return clock


def _row_clock(table: Table, rate_hz: float) -> Clock:
    count = len(next(iter(table.columns.values())))
    decision = Decision("time", f"rows at {rate_hz:g} Hz", "as stated on the command line")
    order = np.arange(count)
    return Clock(ROW_CLOCK, order / rate_hz, 0.0, order, (decision,))


def _log(table: Table, clocks: list[Clock]) -> Log:
    """Rows sorted by the first clock; each column belongs to the clock before it."""
    names = list(table.columns)
    decisions = [*table.decisions, *(d for clock in clocks for d in clock.decisions)]
    columns: list[Column] = []
    texts: list[str] = []
    current = clocks[0] if clocks else None
    by_name = {clock.name: clock for clock in clocks}
    shared = len(clocks) > 1 and not _paired(names, clocks)
    for nth, name in enumerate(names):
        if name in by_name:
            current = by_name[name] if not shared else current
            continue
        values = table.columns[name]
        found = heading(name, table.units.get(name))
        if not isinstance(values, np.ndarray):
            decisions.append(Decision(f"column {name}", "left out", "its cells are words"))
            texts.append(name)
        elif values.dtype.kind == "f" and np.all(np.isnan(values)):
            decisions.append(Decision(f"column {name}", "left out", "it is empty"))
        elif current is not None:
            kept = np.asarray(values[current.order], float)
            columns.append(Column(name, found.name, found.unit, kept, current.name, nth))
    if shared:
        taken = f"times of all columns, not {listed([c.name for c in clocks[1:]])}"
        reason = "it is the first column of times"
        decisions.append(Decision(f"column {clocks[0].name}", taken, reason, check=True))
    return Log(
        table.source,
        tuple(columns),
        {clock.name: clock.elapsed[clock.order] for clock in clocks},
        {clock.name: clock.origin for clock in clocks},
        tuple(decisions),
        table.first_line,
        _lines(table, clocks),
        table.delimiter,
        tuple(texts),
    )


def _paired(names: Sequence[str], clocks: list[Clock]) -> bool:
    """True if each clock is followed by a column of its own: t1, x1, t2, x2."""
    places = [names.index(clock.name) for clock in clocks]
    follows = [*places[1:], len(names)]
    return all(after - place > 1 for place, after in zip(places, follows, strict=True))


def _lines(table: Table, clocks: list[Clock]) -> NDArray[np.int64] | None:
    """Lines of the kept rows of the first clock; None if they are all rows in order."""
    if not clocks:
        return table.lines
    order = clocks[0].order
    count = len(clocks[0].elapsed)
    if len(order) == count and bool(np.all(np.diff(order) == 1)):
        return table.lines
    every: Any = table.lines if table.lines is not None else table.first_line + np.arange(count)
    lines: NDArray[np.int64] = np.asarray(every)[order]
    return lines


__all__ = ["ROW_CLOCK", "Asked", "DataFileError", "Floats", "read_log"]
