"""The order of a log's rows: its recordings, clocks that were set or wrapped, rows out of place.

The order of the file is the truth. Only rows that are displaced by a few intervals are sorted by
their times; where the clock jumps back by more, another recording begins, or the clock was set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mopro.logs.log import Decision, Floats

Rows = NDArray[np.intp]
# True if the readings go on from one row of the file to another one as they do beside them.
GoesOn = Callable[[int, int], bool]

# A row displaced by this many intervals is jitter, unless two rows then lie in each interval.
_JITTER = 10.0
_SURELY = 2.0
_TWICE = 1.6
_NEAR_ROWS = 40
# Intervals between a row and the one after a clock that was set or wrapped.
_NEXT = 1.5
# Most share of its range that a counter passes in a gap of the log: by chance a recording seldom
# ends so near to the end of a range. Nearness of its stamps to whole numbers.
_GAP_SHARE, _WHOLE = 0.01, 1e-3
# A jump back into this first share of a recording begins another one.
_BEGINNING = 0.2
# Jumps back beyond which a column is no clock.
_MOST_JUMPS = 200
_HOUR_S, _DAY_S = 3600.0, 86_400.0
_WORDS = {_HOUR_S: "an hour, as at the end of summer time", _DAY_S: "a day, at midnight"}


class NoClock(ValueError):
    """A column whose times go back too often."""


@dataclass
class Order:
    """Times (s) of all rows on one clock that goes on, and what happened to their order.

    `starts` are the first rows of recordings, `strays` rows whose time is out of place.
    """

    time_s: Floats
    starts: list[int] = field(default_factory=list)
    strays: list[int] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)


@dataclass(frozen=True)
class Habits:
    """Known traits of a clock: its name, seconds of one unit of its column, if it tells dates.

    `origin_s` is its first stamp, in s.
    """

    name: str
    unit_s: float
    worded: bool = False
    origin_s: float = 0.0

    def counters_s(self) -> dict[float, tuple[float, str]]:
        """Times after which a counter begins again, each with that of a count, and its words."""
        return {
            2.0**bits * unit: (unit, f"2^{bits} {word}: its counter wrapped")
            for bits in (16, 32)
            for unit, word in ((1e-6, "us"), (1e-3, "ms"), (self.unit_s, "counts"))
        }

    def periods_s(self) -> dict[float, str]:
        """Times after which a clock like this begins again, each with its words."""
        counters = {period: words for period, (_, words) in self.counters_s().items()}
        return {**counters, **_WORDS} if self.worded else {**counters, _DAY_S: _WORDS[_DAY_S]}


def order_of(time_s: Floats, habits: Habits, goes_on: GoesOn) -> Order:
    """The order of rows by their times (s; NaN where there is none). NoClock."""
    order = Order(time_s)
    if not (np.diff(time_s) <= 0).any() and not np.isnan(time_s).any():
        return order
    known = np.flatnonzero(~np.isnan(time_s))
    times = time_s[known]
    steps = np.diff(times)
    back = np.flatnonzero(steps < 0)
    if not len(back):
        return order
    usual = _usual(steps)
    order.time_s = time_s.copy()
    jumps = [int(i) for i in back if _is_jump(times, int(i), usual)]
    if len(jumps) > _MOST_JUMPS:
        message = f"the times go back {len(jumps)} times: they are no clock"
        raise NoClock(message)
    _Jumps(order, known, times, usual, habits, goes_on).judge(jumps)
    return order


def _usual(steps: Floats) -> float:
    forward = steps[steps > 0]
    return float(np.median(forward)) if len(forward) else 1.0


def _is_jump(times: Floats, i: int, usual: float) -> bool:
    """True if the step back after row `i` is more than jitter."""
    back = float(times[i] - times[i + 1])
    if back <= _SURELY * usual:
        return False
    if back > _JITTER * usual:
        return True
    # Sorted jitter leaves the sampling as it was; a clock that was set passes the times twice.
    near = times[max(i + 1 - _NEAR_ROWS, 0) : i + 1 + _NEAR_ROWS]
    within = int(np.count_nonzero((near >= times[i + 1]) & (near <= times[i])))
    return within >= _TWICE * (back / usual + 1)


class _Jumps:
    """Judges the jumps back of one clock, in their order."""

    def __init__(
        self, order: Order, known: Rows, times: Floats, usual: float, habits: Habits,
        goes_on: GoesOn,
    ) -> None:  # fmt: skip
        self._order, self._known, self._times, self._usual = order, known, times, usual
        self._habits, self._goes_on = habits, goes_on
        self._first = float(times[0])
        # The stamps as they stand in the file.
        self._stamps = habits.origin_s + times

    def judge(self, jumps: list[int]) -> None:
        skipped: set[int] = set()
        for i in jumps:
            if i in skipped:
                continue
            stray = self._stray(i)
            if stray is not None:
                self._order.strays.append(int(self._known[stray]))
                self._order.time_s[self._known[stray]] = np.nan
                skipped |= {stray - 1, stray}
                continue
            self._one(i)

    def _stray(self, i: int) -> int | None:
        """The one row without which the clock goes on: that before the step, or after it."""
        times = self._times

        def fits(before: int, after: int) -> bool:
            if before < 0 or after >= len(times):
                return False
            return 0 < float(times[after] - times[before]) <= _JITTER * self._usual

        if fits(i, i + 2) and not fits(i + 1, i + 2):
            return i + 1
        if fits(i - 1, i + 1) and not fits(i - 1, i):
            return i
        return None

    def _one(self, i: int) -> None:
        before, after = float(self._times[i]), float(self._times[i + 1])
        back = before - after
        row = int(self._known[i + 1])
        for period, words in self._habits.periods_s().items():
            if abs(back + self._usual - period) <= _NEXT * self._usual and period > 4 * self._usual:
                self._go_on(row, period, f"it went back by {words}")
                return
        if wrapped := self._wrapped_in_gap(i):
            self._go_on(row, *wrapped)
            return
        inside = (after - self._first) > _BEGINNING * (before - self._first)
        if inside and self._goes_on(int(self._known[i]), row):
            self._go_on(row, back + self._usual, f"it was set back by {back:.6g} s")
            return
        self._order.starts.append(row)
        self._first = after

    def _wrapped_in_gap(self, i: int) -> tuple[float, str] | None:
        """The range (s) of a counter that wrapped in a gap after row `i`, and the words for that.

        Its stamps are whole numbers within the range, the gap is a small share of it, and the
        log did not begin as near to the least number as the counter is now: else another
        recording began.
        """
        stamps = self._stamps
        for period, (unit, words) in self._habits.counters_s().items():
            gap = float(stamps[i + 1] - stamps[i]) + period
            least = 0.0 if stamps.min() >= 0 else -period / 2
            within = stamps.min() >= least and stamps.max() < least + period
            if within and stamps[0] - least > gap and 0 < gap <= _GAP_SHARE * period:
                counts = stamps / unit
                if np.abs(counts - np.round(counts)).max() < _WHOLE:
                    return period, f"it went back by {words} in a gap of {gap:.6g} s"
        return None

    def _go_on(self, row: int, shift_s: float, reason: str) -> None:
        """Shift the times from `row` on."""
        self._order.time_s[row:] += shift_s
        self._times = self._times.copy()
        at = int(np.searchsorted(self._known, row))
        self._times[at:] += shift_s
        taken = f"goes on at row {row + 1} of the data"
        self._order.decisions.append(
            Decision(f"clock {self._habits.name}", taken, reason, check=True, lasting=True)
        )


# -- one recording ------------------------------------------------------------------------

# Share of rows with the stamp of their neighbour beyond which stamps are coarse.
_COARSE = 0.05
# Distinct stamps of a recording from which its sampling can be told.
_FEWEST_TICKS = 3


class TooCoarse(ValueError):
    """Stamps that do not tell the sampling."""


@dataclass(frozen=True)
class Spread:
    """Times of rows whose stamps repeat: `time_s` ascends within ticks of `tick_s`."""

    time_s: Floats
    tick_s: float
    rows: float


def spread(time_s: Floats) -> Spread | None:
    """Stamps in order (n >= 2), spread within their ticks where they repeat; None if few do.

    Raises TooCoarse.
    """
    same = np.diff(time_s) == 0
    if np.count_nonzero(same) <= _COARSE * len(time_s):
        return None
    first = np.flatnonzero(np.concatenate(([True], ~same)))
    if len(first) < _FEWEST_TICKS:
        raise TooCoarse(f"{len(time_s)} rows have {len(first)} different times")
    ticks, counts = time_s[first], np.diff(np.append(first, len(time_s)))
    tick = float(np.median(np.diff(ticks)))
    evenly = _evenly(time_s, first, ticks, tick)
    times = _by_tick(first, ticks, counts, tick) if evenly is None else evenly
    return Spread(times, tick, float(np.median(counts)))


def _evenly(time_s: Floats, first: Rows, ticks: Floats, tick: float) -> Floats | None:
    """One interval for all rows, if it leaves each in its tick."""
    rows = np.arange(len(time_s), dtype=float)
    # The first row of a tick came within an interval after it began; the very first, anywhere.
    starts, begun = rows[first[1:]], ticks[1:]
    if len(starts) < 2:
        return None
    slope, start = np.polyfit(starts - starts[0], begun - begun[0], 1)
    times = begun[0] + start + slope * (rows - starts[0] + 0.5)
    late = times - time_s
    if slope <= 0 or late.min() < -slope or late.max() > tick + slope:
        return None
    found: Floats = times
    return found


def _by_tick(first: Rows, ticks: Floats, counts: NDArray[np.int64], tick: float) -> Floats:
    """Rows at equal intervals within each tick; the first tick's before its end."""
    widths = np.minimum(np.append(np.diff(ticks), tick), tick)
    steps = widths / counts
    usual = tick / float(np.median(counts))
    steps[-1] = min(steps[-1], usual)
    steps[0] = min(steps[0], usual)
    nth = np.arange(int(counts.sum())) - np.repeat(first, counts)
    times = np.repeat(ticks, counts) + nth * np.repeat(steps, counts)
    times[: counts[0]] += widths[0] - counts[0] * steps[0]
    found: Floats = times
    return found
