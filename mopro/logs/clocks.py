"""Clocks of a log, and its rows on them, recording by recording.

A clock: which columns are times, of which unit, and what is wrong with them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.log import Decision, Floats, Table
from mopro.logs.order import Habits, TooCoarse, order_of, spread
from mopro.logs.stamps import PER_S, UNSURE, epoch_unit, seconds_of_numbers, seconds_of_words
from mopro.logs.timed import Stamp, TimeColumns

# -- clocks -----------------------------------------------------------------------------------
# Clocks of a log: which columns are times, of which unit, and what is wrong with them.


# Rows beside a jump of the clock whose changes are usual ones, and how much more is a jump.
_BESIDE = 50
_LEAP = 3.0


@dataclass(frozen=True)
class Clock:
    """A clock: seconds of each row of the file from the first stamp (NaN where there is none).

    `starts` are the rows with which further recordings begin, `strays` those whose time is out of
    place, `origin` is the first stamp in s.
    """

    stamp: Stamp
    time_s: Floats
    origin: float
    decisions: tuple[Decision, ...]
    starts: tuple[int, ...] = ()
    strays: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        return self.stamp.name


# -- their times --------------------------------------------------------------------------


def clock_of(table: Table, stamp: Stamp, unit: str | None = None) -> Clock:
    """The clock of a stamp, whose numbers are in `unit` if the caller knows it.

    Raises stamps.NoStamp for a cell that is no time, order.NoClock for times that are no clock.
    """
    values = table.columns[stamp.name]
    subject = f"column {stamp.name}"
    unit_s, worded = 1.0, not isinstance(values, np.ndarray)
    if worded:
        text, together = words_of_stamp(table, stamp)
        elapsed, origin, how = seconds_of_words(text)
        check = how.endswith(UNSURE)
        decisions = [Decision(subject, f"times ({how})", f"the cells say so{together}", check)]
    else:
        stated = TimeColumns(table).heading(stamp.name)
        taken, reason, check = _unit(values, unit, stated.unit, stated.reason)
        elapsed, origin = seconds_of_numbers(values, taken)
        unit_s = 1 / PER_S[taken]
        decisions = [Decision(subject, f"times in {taken}", reason, check)]
    if stamp.finer is not None:
        part = TimeColumns(table).heading(stamp.finer).unit or "ms"
        parts = np.asarray(table.columns[stamp.finer], float) / PER_S[part]
        elapsed = elapsed + parts
        first = float(elapsed[~np.isnan(elapsed)][0]) if (~np.isnan(elapsed)).any() else 0.0
        elapsed, origin = elapsed - first, origin + first
        taken = f"{part} of the seconds in {stamp.name}"
        decisions.append(Decision(f"column {stamp.finer}", taken, "two columns are one stamp"))
    habits = Habits(stamp.name, unit_s, worded, origin)
    order = order_of(elapsed, habits, _readings_go_on(table, stamp))
    return Clock(
        stamp, order.time_s, origin, (*decisions, *order.decisions), tuple(order.starts),
        tuple(order.strays),
    )  # fmt: skip


def words_of_stamp(table: Table, stamp: Stamp) -> tuple[Any, str]:
    """The words of a stamp, behind those of its date if another column has them."""
    import pyarrow as pa
    import pyarrow.compute as pc

    words = table.columns[stamp.name]
    if stamp.date is None:
        return words, ""
    dates = table.columns[stamp.date]
    if isinstance(dates, np.ndarray):
        numbers = pa.array(dates.astype(float), from_pandas=True)
        digits = pc.cast(pc.cast(numbers, pa.int64()), pa.string())
        dates = pc.replace_substring_regex(digits, r"^(\d{4})(\d\d)(\d\d)$", r"\1-\2-\3")
    dates, words = map(pc.utf8_trim_whitespace, (dates, words))
    return pc.binary_join_element_wise(dates, words, " "), f", with the date in {stamp.date}"


def _readings_go_on(table: Table, stamp: Stamp) -> Any:
    columns = [
        values
        for name, values in table.columns.items()
        if name not in stamp.parts and isinstance(values, np.ndarray) and values.dtype.kind == "f"
    ]

    def goes_on(before: int, after: int) -> bool:
        return all(_is_small(values, before, after) for values in columns)

    return goes_on


def _is_small(values: Floats, before: int, after: int) -> bool:
    """True if a column changes from one row to another one no more than beside them."""
    near = [values[max(before - _BESIDE, 0) : before + 1], values[after : after + _BESIDE]]
    changes = [np.abs(np.diff(part[~np.isnan(part)])) for part in near]
    usual = max((float(c.max()) for c in changes if len(c)), default=0.0)
    leap = abs(float(values[after] - values[before]))
    return bool(np.isnan(leap)) or leap <= _LEAP * usual


def _unit(
    values: NDArray[Any], given: str | None, stated: str | None, reason: str
) -> tuple[str, str, bool]:
    """Unit of a column of times, why, and true if somebody should confirm it."""
    if given is not None:
        return given, "as stated on the command line", False
    if stated in PER_S:
        return str(stated), reason, False
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if len(known) and (epoch := epoch_unit(float(known[0]))):
        return epoch, f"{float(known[0]):.10g} is a date of this century in {epoch}", False
    step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
    return "s", f"no unit is stated; then {step:.6g} s lie between rows", True


# -- recordings -------------------------------------------------------------------------------
# The rows of a log on a clock, recording by recording, and those that have no place there.

Ints = NDArray[np.intp]
# For rows and those after them: True where a column has two readings that differ.
Conflict = Callable[[Ints, Ints], NDArray[np.bool_]]

NO_TIME = "without a time"
STRAY = "whose time is out of place"
SHORT = "in a recording of a single time"
DOUBLE = "whose time is that of the next row"
# Share of rows of one time with different readings beyond which the stamps are coarse.
_DIFFER = 0.1
# Usual intervals between two recordings on the clock that goes over all of them.
_BETWEEN = 100.0


@dataclass(frozen=True)
class Placed:
    """Rows of the file that a clock keeps, in order: `rows` (n), at `time_s` (n) from the start.

    The times go on from one recording to the next, which begin at the rows `starts` and had the
    first stamps `origins` (s). `first` (n, or None for none) is where the rows of the same time
    begin whose readings each row has, too. `left_out` are rows of the file by reason.
    """

    clock: Clock
    rows: Ints
    time_s: Floats
    starts: tuple[int, ...]
    origins: tuple[float, ...]
    merged: tuple[Ints, Ints, Ints] | None
    left_out: dict[str, Ints]
    decisions: tuple[Decision, ...]

    def values(self, column: NDArray[np.generic]) -> Floats:
        """The readings of a column in the rows that are kept."""
        if self.merged is None:
            kept: Floats = np.asarray(column[self.rows], float)
            return kept
        every, first, last = self.merged
        values = np.asarray(column[every], float)
        latest = np.maximum.accumulate(np.where(np.isnan(values), -1, np.arange(len(values))))
        found: Floats = np.where(latest[last] >= first, values[latest[last]], np.nan)
        return found


def boundaries(clocks: Sequence[Clock]) -> list[int]:
    """Rows of the file with which recordings begin, after the first, by any clock."""
    return sorted({start for clock in clocks for start in clock.starts})


def placed(clock: Clock, begins: Sequence[int], conflict: Conflict) -> Placed:
    """The rows on `clock`, in recordings that begin at the rows `begins` of the file, and row 0.

    Raises order.TooCoarse.
    """
    return _Placing(clock, conflict).all([0, *begins, len(clock.time_s)])


@dataclass(frozen=True)
class _Piece:
    """One recording: rows of the file and their stamps in s, in order of time."""

    rows: Ints
    time_s: Floats


class _Placing:
    def __init__(self, clock: Clock, conflict: Conflict) -> None:
        self._clock, self._conflict = clock, conflict
        self._decisions: list[Decision] = []
        self._left_out: dict[str, Ints] = {}
        self._subject = f"column {clock.name}"

    def all(self, edges: Sequence[int]) -> Placed:
        clock = self._clock
        if len(edges) == 2 and len(clock.time_s) > 1 and (np.diff(clock.time_s) > 0).all():
            every = np.arange(len(clock.time_s))  # nothing is out of order, as in most logs
            return self._placed([_Piece(every, clock.time_s)], None)
        absent = np.flatnonzero(np.isnan(clock.time_s))
        self._leave_out(STRAY, np.array(clock.strays, int))
        self._leave_out(NO_TIME, np.setdiff1d(absent, clock.strays))
        pieces = [self._piece(a, b) for a, b in pairwise(edges)]
        long = [piece for piece in pieces if len(piece.rows) and np.ptp(piece.time_s) > 0]
        for piece in pieces:
            if len(piece.rows) and np.ptp(piece.time_s) == 0:
                self._leave_out(SHORT, piece.rows)
        if not long:
            raise TooCoarse("it has fewer than two times")
        self._tell(long)
        merged = self._merged(long)
        if merged is None:
            return self._placed(long, None)
        pieces, every, first, last = merged
        return self._placed(pieces, (every, first, last))

    def _placed(
        self, pieces: Sequence[_Piece], merged: tuple[Ints, Ints, Ints] | None
    ) -> Placed:  # fmt: skip
        lengths = [len(piece.rows) for piece in pieces]
        rows = [piece.rows for piece in pieces]
        return Placed(
            self._clock,
            rows[0] if len(rows) == 1 else np.concatenate(rows),
            _going_on([piece.time_s for piece in pieces]),
            tuple(int(n) for n in np.concatenate(([0], np.cumsum(lengths)[:-1]))),
            tuple(self._clock.origin + float(piece.time_s[0]) for piece in pieces),
            merged,
            self._left_out,
            tuple(self._decisions),
        )

    def _leave_out(self, why: str, rows: Ints) -> None:
        if len(rows):
            before = self._left_out.get(why, np.empty(0, int))
            self._left_out[why] = np.concatenate((before, rows))
            where = f"first at row {int(rows.min()) + 1} of the data"
            taken = f"{len(rows)} rows left out {why}"
            self._decisions.append(Decision(self._subject, taken, where))

    def _piece(self, begin: int, end: int) -> _Piece:
        """The recording in these rows of the file, sorted within the reach of jitter."""
        times = self._clock.time_s[begin:end]
        rows = np.flatnonzero(~np.isnan(times))
        times = times[rows]
        back = int(np.count_nonzero(np.diff(times) < 0))
        if back:
            where = f"first at row {begin + int(np.flatnonzero(np.diff(times) < 0)[0]) + 2}"
            taken = f"rows sorted by time: the clock runs backwards {back} times by a few intervals"
            self._decisions.append(Decision(self._subject, taken, f"{where} of the data"))
            order = np.argsort(times, kind="stable")
            rows, times = rows[order], times[order]
        return _Piece(rows + begin, times)

    def _tell(self, pieces: Sequence[_Piece]) -> None:
        if len(pieces) < 2:
            return
        lengths = ", ".join(str(len(piece.rows)) for piece in pieces[:8])
        more = ", ..." if len(pieces) > 8 else ""
        taken = f"{len(pieces)} recordings of {lengths}{more} rows, in the file's order"
        rows = ", ".join(str(int(piece.rows.min()) + 1) for piece in pieces[1:9])
        reason = f"the clock jumps back at row {rows}{more} of the data"
        self._decisions.append(Decision(self._subject, taken, reason, True, True))

    # -- rows of one time ------------------------------------------------------------------

    def _merged(
        self, pieces: list[_Piece]
    ) -> tuple[list[_Piece], Ints, Ints, Ints] | None:  # fmt: skip
        """Spreads coarse stamps in place; else makes one row of those of one time."""
        pairs, differ = self._of_one_time(pieces)
        if sum(map(np.count_nonzero, differ)) > _DIFFER * sum(map(len, differ)):
            pieces[:] = [self._spread(piece) for piece in pieces]
            pairs, differ = self._of_one_time(pieces)
        if not any(map(len, differ)):
            return None
        lost = np.concatenate([a[d] for (a, _), d in zip(pairs, differ, strict=True)])
        self._leave_out(DOUBLE, lost)
        count = sum(map(len, differ))
        if joined := count - len(lost):
            reason = "no column has two readings of one time"
            taken = f"{joined} rows are one with the next row of the same time"
            self._decisions.append(Decision(self._subject, taken, reason))
        every = np.concatenate([piece.rows for piece in pieces])
        begins = np.concatenate(
            [np.concatenate(([True], np.diff(piece.time_s) != 0)) for piece in pieces]
        )
        first = np.flatnonzero(begins)
        last = np.append(first[1:], len(every)) - 1
        kept = [_Piece(p.rows[k], p.time_s[k]) for p in pieces for k in [_lasts(p.time_s)]]
        return kept, every, first, last

    def _of_one_time(
        self, pieces: Sequence[_Piece]
    ) -> tuple[list[tuple[Ints, Ints]], list[NDArray[np.bool_]]]:
        """In each piece: rows and those after them at the same time, and which of them differ."""
        same = [np.flatnonzero(np.diff(piece.time_s) == 0) for piece in pieces]
        pairs = [(p.rows[at], p.rows[at + 1]) for p, at in zip(pieces, same, strict=True)]
        return pairs, [self._conflict(a, b) for a, b in pairs]

    def _spread(self, piece: _Piece) -> _Piece:
        found = spread(piece.time_s)
        if found is None:
            return piece
        taken = (
            f"{found.rows:g} rows at a time have one stamp: spread evenly over {found.tick_s:g} s"
        )
        reason = "the stamps are coarser than the sampling; --rate HZ states it"
        decision = Decision(self._subject, taken, reason, True, True)
        if decision not in self._decisions:
            self._decisions.append(decision)
        return _Piece(piece.rows, found.time_s)


def _lasts(time_s: Floats) -> Ints:
    """The last row of each time."""
    return np.flatnonzero(np.concatenate((np.diff(time_s) != 0, [True])))


def _going_on(pieces: Sequence[Floats]) -> Floats:
    """Times from the first stamp that go on from one recording to the next, with a gap between."""
    if len(pieces) == 1:
        alone: Floats = pieces[0] - pieces[0][0]
        return alone
    times, end = [], 0.0
    for piece in pieces:
        own = piece - piece[0] + end
        times.append(own)
        end = float(own[-1]) + _BETWEEN * float(np.median(np.diff(piece)))
    found: Floats = np.concatenate(times)
    return found
