"""The repetition of a run: stretches of samples in which a loop commands the same again.

What drives an axis is a set of courses: rows of values, each of which holds from its time on (the
command, the share of the current, ...). A stretch is a whole number of rounds of the loop and of
samples, so that a motion which repeats itself shows the same samples in every stretch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mopro.motion import PlannedMove

Floats = NDArray[np.float64]

# Rounds may come so much early or late (s), each and all together: what sums of times are rounded
# by. At 1 m/s a motor is a hundredth of a microstep farther then.
_ROUND_S, _ALL_S = 1e-9, 1e-8
# Values of a row may differ by this share of their largest.
_SHARE = 1e-9
# No stretch begins so close (s) to a row's first time, which rounding could put on either side.
_APART_S = 1e-6
_MOST_ROUNDS = 1000
_MOST_SAMPLES = 1 << 17
# Moves that begin as one in the middle of the run, of which each may be its next round.
_MOST_TRIES = 100


class Course(NamedTuple):
    """Rows of `values` (n, columns), each of which holds from its time (s, ascending) on."""

    times_s: Floats
    values: Floats


@dataclass(frozen=True)
class Repetition:
    """From the sample `first` on, each stretch of `samples` is commanded as the one before.

    True up to `until_s`. The sample before `first` ends what comes before.
    """

    first: int
    samples: int
    rate_hz: float
    until_s: float

    @property
    def period_s(self) -> float:
        """The time (s) of a stretch."""
        return self.samples / self.rate_hz

    def stretches(self, first: int, end_s: float) -> int:
        """The whole stretches from the sample `first` on that end by `end_s`."""
        left = (min(self.until_s, end_s) - (first - 1) / self.rate_hz) / self.period_s
        return max(math.floor(left), 0)


def repetition(
    moves: Sequence[PlannedMove], courses: Sequence[Course], rate_hz: float
) -> Repetition | None:
    """The repetition of a run at its samples; None if it has none.

    `courses` are all that the motion and its columns follow. The first rounds may differ.
    """
    starts_s = np.array([move.start_s for move in moves])
    numbers: dict[object, int] = {}
    kinds = [numbers.setdefault((m.span, m.strokes), len(numbers)) for m in moves]
    found = _round(np.array(kinds, dtype=np.intp))
    if found is None:
        return None
    first, length = found
    count = (len(moves) - 1 - first) // length
    round_s = float(starts_s[first + count * length] - starts_s[first]) / count
    samples = _stretch(round_s, count, rate_hz)
    if samples is None:
        return None
    period_s = samples / rate_hz
    all_courses = [*courses, Course(starts_s, np.array(kinds, dtype=np.float64)[:, None])]
    begin = _begin(all_courses, float(starts_s[first]), samples, rate_hz)
    if begin is None:
        return None
    until_s = min(_alike_until(c, (begin - 1) / rate_hz, period_s) for c in all_courses)
    return Repetition(begin, samples, rate_hz, until_s)


def _round(kinds: NDArray[np.intp]) -> tuple[int, int] | None:
    """The first move of the rounds, and the moves of one, by the kind of each move."""
    middle = len(kinds) // 2
    again = np.flatnonzero(kinds[middle + 1 :] == kinds[middle : middle + 1]) + 1
    for length in again[:_MOST_TRIES].tolist():
        alike = kinds[length:] == kinds[:-length]
        if alike[middle:].all():
            unlike = np.flatnonzero(~alike[:middle])
            return (int(unlike[-1]) + 1 if len(unlike) else 0), length
    return None


def _stretch(round_s: float, count: int, rate_hz: float) -> int | None:
    """The samples of the shortest stretch, of rounds of `round_s`, of which there are `count`."""
    rounds = np.arange(1, min(_MOST_ROUNDS, count) + 1)
    samples = np.rint(rounds * round_s * rate_hz)
    late_s = np.abs(samples / (rounds * rate_hz) - round_s) * count
    fits = np.flatnonzero((late_s < _ALL_S) & (samples > 0) & (samples <= _MOST_SAMPLES))
    return int(samples[fits[0]]) if len(fits) else None


def _begin(courses: Sequence[Course], start_s: float, samples: int, rate_hz: float) -> int | None:
    """The first sample after `start_s` before which no row begins, in any stretch."""
    period_s = samples / rate_hz
    first = math.ceil(start_s * rate_hz) + 1
    window = start_s, start_s + 2 * period_s
    times_s = [c.times_s[slice(*np.searchsorted(c.times_s, window))] for c in courses]
    phases = np.unique(np.concatenate(times_s) % period_s)
    for begin in range(first, first + samples):
        away = np.abs(phases - (begin - 1) / rate_hz % period_s)
        if np.minimum(away, period_s - away).min(initial=math.inf) > _APART_S:
            return begin
    return None


def _alike_until(course: Course, start_s: float, period_s: float) -> float:
    """The time (s) up to which the course from `start_s` on is that of a period before."""
    times_s, values = course
    first, end = np.searchsorted(times_s, [start_s, start_s + period_s]).tolist()
    count = end - first
    if not count:
        return float(times_s[first]) if first < len(times_s) else math.inf
    # The row before the first holds at the start.
    held = max(first - 1, 0)
    near = np.abs(values[held + count :] - values[held : len(values) - count])
    alike = (near <= _SHARE * np.abs(values).max(axis=0)).all(axis=1)
    late_s = times_s[first + count :] - times_s[first : len(times_s) - count] - period_s
    alike[first - held :] &= np.abs(late_s) < _ROUND_S
    row = held + (len(alike) if alike.all() else int(np.argmin(alike)))
    # The row that comes too early, or another, and the one that should have come.
    came = times_s[row + count : row + count + 1]
    return float(min([*came, times_s[row] + period_s]))
