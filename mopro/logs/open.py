"""Opens a log: its table, its clocks, its columns with names and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError, DataFileError
from mopro.inputs import open_to_read
from mopro.logs.cell_kinds import as_number
from mopro.logs.cells import with_lists, without_missing, without_overload
from mopro.logs.clocks import Clock, Ints, Placed, boundaries, clock_of, placed, words_of_stamp
from mopro.logs.column_names import heading
from mopro.logs.containers import READERS
from mopro.logs.delimited import read_text
from mopro.logs.file_kinds import refuse_foreign, suffix_of
from mopro.logs.grbl import is_grbl, read_grbl
from mopro.logs.log import Column, Decision, Floats, Log, Rows, Table, listed
from mopro.logs.order import NoClock, TooCoarse
from mopro.logs.stamps import NoStamp, seconds_of_words
from mopro.logs.timed import Stamp, stamps_in

# Rows of which the direction is taken, and the share of steps back that makes it.
_SAMPLE = 1000
_MOST = 0.8


def oldest_first(table: Table, stamps: list[Stamp]) -> Table:
    """The table with its rows in the order of time: turned round if its first stamp descends."""
    if not stamps or not _descends(table, stamps[0]):
        return table
    reason = "the newest row is the first: rows are counted from the last one"
    from_end = Decision(f"column {stamps[0].name}", "read from the end", reason, True, True)
    every = table.first_line + np.arange(table.rows) if table.lines is None else table.lines
    return replace(
        table,
        columns={name: values[::-1] for name, values in table.columns.items()},
        lines=every[::-1],
        decisions=(*table.decisions, from_end),
    )


def _descends(table: Table, stamp: Stamp) -> bool:
    times = _sampled(table, stamp)
    steps = np.diff(times[~np.isnan(times)])
    steps = steps[steps != 0]
    return len(steps) > 1 and bool(np.mean(steps < 0) > _MOST)


def _sampled(table: Table, stamp: Stamp) -> Floats:
    """Times of the first rows, in any unit."""
    values = table.columns[stamp.name]
    if isinstance(values, np.ndarray):
        own: NDArray[np.float64] = np.asarray(values[:_SAMPLE], float)
        return own
    words, _ = words_of_stamp(table, stamp)
    try:
        return seconds_of_words(words.slice(0, _SAMPLE))[0]
    except NoStamp:
        return np.zeros(0)  # told with its line where all are read


ROW_CLOCK = "row"


@dataclass(frozen=True)
class Asked:
    """Facts about a log that the caller states: column and unit of the times, or the rate instead.

    `missing` are words, or numbers, that stand for a missing reading.
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
    stamps = [] if asked.rate_hz is not None else _stamps(table, asked.time)
    parts = {part for stamp in stamps for part in stamp.parts}
    table = oldest_first(without_missing(table, parts, asked.missing), stamps)
    clocks = [_clock(table, stamp, asked.time_unit) for stamp in stamps]
    if asked.rate_hz is not None:
        clocks = [_row_clock(table, asked.rate_hz)]
    return _log(table, clocks, _placed(table, clocks))


def _table(path: Path, asked: Asked) -> Table:
    stated = asked.rate_hz is not None or (asked.time or "").startswith("column ")
    words = tuple(word for word in asked.missing if as_number(word) is None)
    try:
        open_to_read(path).close()
        reader = READERS.get(suffix_of(path))
        if reader is None:
            head = refuse_foreign(path)
            reader = read_grbl if is_grbl(head) else None
        table = reader(path, str(path)) if reader else read_text(path, str(path), words, stated)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{path}: cannot be read: {reason}", "unreadable") from error
    return without_overload(with_lists(table))


def _stamps(table: Table, asked: str | None) -> list[Stamp]:
    if asked is not None and asked not in table.columns:
        known = listed(list(table.columns))
        message = f"{table.source.name}: there is no column {asked}; there are {known}"
        raise DataError(message, "missing-column")
    stamps = stamps_in(table, asked)
    if not stamps:
        known = listed(list(table.columns))
        message = f"{table.source.name}: no column of times was found among {known}"
        hint = "say which it is with --time COLUMN, or how fast the rows follow with --rate HZ"
        raise DataError(f"{message}; {hint}", "which-time")
    return stamps


def _clock(table: Table, stamp: Stamp, unit: str | None) -> Clock:
    try:
        return clock_of(table, stamp, unit)
    except NoStamp as error:
        empty = _log(table, [], [])
        nth = list(table.columns).index(stamp.name)
        raise empty.refuse("clock", f"{stamp.name}: {error}", error.row, nth) from error
    except NoClock as error:
        raise _no_clock(table, stamp.name, error) from error


def _no_clock(table: Table, name: str, error: ValueError) -> DataError:
    hint = "say which column is the clock with --time COLUMN, or state --rate HZ"
    return DataError(f"{table.source.name}: column {name}: {error}; {hint}", "clock")


def _row_clock(table: Table, rate_hz: float) -> Clock:
    decision = Decision("time", f"rows at {rate_hz:g} Hz", "as stated on the command line")
    return Clock(Stamp(ROW_CLOCK), np.arange(table.rows) / rate_hz, 0.0, (decision,))


def _placed(table: Table, clocks: list[Clock]) -> list[Placed]:
    """The rows of each clock, which has at least two in every recording."""
    parts = {part for clock in clocks for part in clock.stamp.parts}
    columns = [
        values
        for name, values in table.columns.items()
        if name not in parts and isinstance(values, np.ndarray)
    ]

    def conflict(rows: Ints, following: Ints) -> NDArray[np.bool_]:
        found = np.zeros(len(rows), bool)
        for values in columns:
            before, after = values[rows], values[following]
            found |= (before != after) & ~np.isnan(before) & ~np.isnan(after)
        return found

    begins, found = boundaries(clocks), []
    for clock in clocks:
        try:
            found.append(placed(clock, begins, conflict))
        except TooCoarse as error:
            raise _no_clock(table, clock.name, error) from error
    return found


def _log(table: Table, clocks: list[Clock], places: list[Placed]) -> Log:
    """Rows in order; each column belongs to the clock before it."""
    names = list(table.columns)
    decisions = [*table.decisions, *(d for clock in clocks for d in clock.decisions)]
    decisions += [d for place in places for d in place.decisions]
    columns: list[Column] = []
    current = places[0] if places else None
    by_name = {place.clock.name: _first_alike(place, places) for place in places}
    for name, place in by_name.items():
        if place.clock.name != name:
            taken, reason = f"the clock {place.clock.name}", "its times are the same"
            decisions.append(Decision(f"column {name}", taken, reason))
    places = [place for place in places if by_name[place.clock.name] is place]
    parts = {part for clock in clocks for part in clock.stamp.parts}
    shared = len(places) > 1 and not _paired(_filled(table), clocks)
    for name in names:
        if name in by_name:
            current = by_name[name] if not shared else current
        if name in parts:
            continue
        values = table.columns[name]
        found = heading(name, table.units.get(name))
        if not isinstance(values, np.ndarray):
            decisions.append(Decision(f"column {name}", "left out", "its cells are words"))
        elif values.dtype.kind == "f" and np.all(np.isnan(values)):
            decisions.append(Decision(f"column {name}", "left out", "it is empty"))
        elif current is not None:
            kept = current.values(values)
            columns.append(Column(name, found.name, found.unit, kept, current.clock.name))
    if shared:
        taken = f"times of all columns, not {listed([c.name for c in clocks[1:]])}"
        reason = "it is the first column of times"
        decisions.append(Decision(f"column {clocks[0].name}", taken, reason, check=True))
    return Log(
        table.source,
        tuple(columns),
        {place.clock.name: place.time_s for place in places},
        {place.clock.name: place.origins[0] for place in places},
        tuple(decisions),
        table.first_line,
        _lines(table, places),
        table.delimiter,
        _ledger(table, places),
        {place.clock.name: place.starts for place in places},
        {place.clock.name: place.origins for place in places},
    )


def _ledger(table: Table, places: list[Placed]) -> Rows:
    """Rows that no clock keeps are left out, for the first clock's reason."""
    rows = Rows(table.rows + sum(table.left_out.values()), dict(table.left_out))
    lost = np.ones(table.rows, bool)
    for place in places:
        own = np.zeros(table.rows, bool)
        for gone in place.left_out.values():
            own[gone] = True
        lost &= own
    for place in places[:1]:
        for why, gone in place.left_out.items():
            rows = rows.without(why, int(np.count_nonzero(lost[gone])))
    return rows


def _first_alike(place: Placed, places: Sequence[Placed]) -> Placed:
    """The first of the places with the same times, which is the same clock."""
    return next(
        other
        for other in places
        if other is place
        or (
            other.origins == place.origins
            and np.array_equal(other.rows, place.rows)
            and np.array_equal(other.time_s, place.time_s)
        )
    )


def _filled(table: Table) -> list[str]:
    """The columns that are not empty; a comma behind each row makes one that is."""
    return [
        name
        for name, values in table.columns.items()
        if not isinstance(values, np.ndarray)
        or values.dtype.kind != "f"
        or not np.all(np.isnan(values))
    ]


def _paired(names: Sequence[str], clocks: list[Clock]) -> bool:
    """True if each clock is followed by a column of its own: t1, x1, t2, x2."""
    places = [names.index(clock.name) for clock in clocks]
    follows = [*places[1:], len(names)]
    return all(after - place > 1 for place, after in zip(places, follows, strict=True))


def _lines(table: Table, places: list[Placed]) -> NDArray[np.int64] | None:
    """Lines of the kept rows of the first clock; None if they are all rows in order."""
    if not places:
        return table.lines
    rows = places[0].rows
    if len(rows) == table.rows and bool(np.all(np.diff(rows) == 1)):
        return table.lines
    every: Any = (
        table.lines if table.lines is not None else table.first_line + np.arange(table.rows)
    )
    lines: NDArray[np.int64] = np.asarray(every)[rows]
    return lines


__all__ = ["ROW_CLOCK", "Asked", "DataFileError", "Floats", "read_log"]
