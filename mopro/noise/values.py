"""What single readings tell of a sensor: its step, odd readings, the ends of its range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

# -- the step of a converter ------------------------------------------------------------------
# Step of a converter (quantisation), found from the set of distinct readings.


Floats = NDArray[np.float64]

# Distinct readings whose differences may have a common step: two have one by themselves.
_FEWEST_VALUES = 3
# Share of the largest reading that is the rounding of binary digits.
_BINARY_DIGITS = 1e-12
# Distinct readings that are looked at: differences of neighbours need no more. Doubled, twice the
# time.
_MOST_VALUES = 20_000
# Deviation from whole steps, in steps: values without a step deviate by 0.29 RMS. Doubled, some of
# those have a step; halved, printed digits that round a step by a third of it hide it.
_MOST_DEVIATION = 0.12
# Readings for each distinct one, below which they repeat so seldom that a step says nothing about
# the noise. Doubled, a record needs twice the readings to tell it.
_LEAST_REPEATED = 2.0
# Noise from which rounding is as good as uniform (Sheppard's correction), in steps.
SHEPPARD = 0.6


def step_of(values: Floats) -> float:
    """The smallest step of which all differences of readings are multiples; 0 if there is none.

    Printed digits may round the steps themselves: 0.32, 0.33, 0.32 are one step of 0.324.
    """
    distinct = distinct_of(values)
    if len(distinct) < _FEWEST_VALUES:
        return float(distinct[-1] - distinct[0]) if len(distinct) == 2 else 0.0
    if len(values) < _LEAST_REPEATED * len(distinct):
        return 0.0
    distinct = distinct[:_MOST_VALUES]
    gaps = np.diff(distinct)
    least = _least_gap(gaps)
    counts = np.rint(gaps / least)
    if np.any(counts < 1):
        return 0.0
    codes = np.concatenate(([0.0], np.cumsum(counts)))
    slope, start = np.polyfit(codes, distinct, 1)
    deviation = distinct - start - slope * codes
    return float(slope) if np.std(deviation) < _MOST_DEVIATION * slope else 0.0


def distinct_of(values: Floats) -> Floats:
    """The distinct readings in order; those that differ by a rounding of binary digits are one."""
    ordered = np.unique(values)
    least = _BINARY_DIGITS * max(float(np.abs(ordered[[0, -1]]).max()), 1e-300)
    return ordered[np.concatenate(([True], np.diff(ordered) > least))]


def _least_gap(gaps: Floats) -> float:
    """The mean of the gaps of one step: those within half of the smallest (a low quantile)."""
    low = float(np.quantile(gaps, 0.02))
    return float(np.mean(gaps[gaps < 1.5 * low]))


def rms_before_rounding(stretches: list[Floats], rms: float, step: float) -> float:
    """The standard deviation of the signal before a converter with `step` rounded it.

    With much noise Sheppard's correction; with little the most likely level for the counts of
    the codes, each stretch with its own mean. 0 where no stretch has more than one code.
    """
    if step <= 0:
        return rms
    if rms >= SHEPPARD * step:
        return float(np.sqrt(max(rms**2 - step**2 / 12, 0.0)))
    counted = [_counted(stretch, step) for stretch in stretches]
    counted = [pair for pair in counted if len(pair[0]) > 1]
    return step * _likeliest(counted) if counted else 0.0


def _counted(stretch: Floats, step: float) -> tuple[Floats, Floats]:
    """Codes relative to the stretch's lowest reading, and how often each occurs."""
    codes = np.rint((stretch - stretch.min()) / step)
    values, counts = np.unique(codes, return_counts=True)
    return values, counts.astype(float)


def _likeliest(counted: list[tuple[Floats, Floats]]) -> float:
    """The standard deviation, in steps, that makes the counts of all stretches likeliest."""

    def cost(log_sigma: float) -> float:
        sigma = float(np.exp(log_sigma))
        return sum(_cost_of(codes, counts, sigma) for codes, counts in counted)

    found = optimize.minimize_scalar(cost, bounds=(np.log(0.02), np.log(2.0)), method="bounded")
    return float(np.exp(found.x))


def _cost_of(codes: Floats, counts: Floats, sigma: float) -> float:
    """Negative log-likelihood of one stretch at its best mean."""

    def cost(mean: float) -> float:
        upper, lower = (special.ndtr((codes + half - mean) / sigma) for half in (0.5, -0.5))
        return -float(counts @ np.log(np.maximum(upper - lower, 1e-300)))

    middle = float(counts @ codes / counts.sum())
    found = optimize.minimize_scalar(cost, bounds=(middle - 0.6, middle + 0.6), method="bounded")
    return float(found.fun)


# -- odd readings -----------------------------------------------------------------------------
# Readings that are not noise: outliers, stuck stretches, values held between updates.

Indices = NDArray[np.intp]

# Chance that normal noise without outliers shows one. Doubled, one record in 500 does.
_FALSE_ALARM = 1e-3
# Standard deviation of normal noise, in median distances from its median.
MAD_TO_SIGMA = 1.4826
# Chance that noise repeats itself so often by accident; small, as readings are not independent.
# Doubled, a sensor is stuck from a run on that is shorter by 3 %.
STUCK_ALARM = 1e-6
# Share of readings equal to the one before, above which the sensor holds its value: held for two,
# it is a half. Halved, a coarse converter passes for one that holds.
_HELD_SHARE = 0.45
# Runs of equal readings that tell how long they usually are. Doubled, records of 20 updates and
# less do not tell that a value is held.
_FEWEST_RUNS = 10
# Share of the runs that last a whole number of updates; from so many readings on, one more or less.
# A coarse converter's do by chance: halved slack, clocks that beat pass for that.
_HELD_FITS = 0.9
_LEAST_SLACK = 4


def outliers_of(values: Floats, step: float = 0.0) -> Indices:
    """Indices of readings too far from the median for normal noise of the robust width."""
    centre = float(np.median(values))
    width = MAD_TO_SIGMA * float(np.median(np.abs(values - centre)))
    width = float(np.hypot(width, step / 2))
    limit = -float(special.ndtri(_FALSE_ALARM / (2 * len(values)))) * max(width, 1e-300)
    return np.flatnonzero(np.abs(values - centre) > limit)


def stuck_of(values: Floats) -> list[tuple[int, int]]:
    """Stretches (start, end) of equal readings too long for the way the others change.

    None where most readings repeat: a coarse converter does not tell.
    """
    starts, lengths = runs_of(values)
    repeats = len(values) - len(starts)
    # The longest run may itself be what repeats most.
    share = max(repeats - int(lengths.max() - 1), 0) / max(len(values) - int(lengths.max()), 1)
    if share > 0.9 or len(starts) < _FEWEST_RUNS:
        return []
    share = max(share, 1 / len(values))
    longest = 2 + np.log(len(values) / STUCK_ALARM) / -np.log(share)
    long = np.flatnonzero(lengths > longest)
    return [(int(starts[i]), int(starts[i] + lengths[i])) for i in long]


def held_of(values: Floats) -> int:
    """Readings for which a value is held; 1 if the signal is new in each.

    A value is held where the runs of equal readings are whole multiples of one length.
    """
    _, lengths = runs_of(values)
    inner = lengths[1:-1]
    if len(inner) < _FEWEST_RUNS or 1 - len(lengths) / len(values) < _HELD_SHARE:
        return 1
    usual = int(np.median(inner))
    slack = 1 if usual > _LEAST_SLACK else 0
    beyond = inner % usual
    fits = float(np.mean((beyond <= slack) | (beyond >= usual - slack) & (inner > slack)))
    return usual if usual > 1 and fits > _HELD_FITS else 1


def runs_of(values: Floats) -> tuple[Indices, Indices]:
    """Start and length of each run of equal readings."""
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0) + 1))
    return starts, np.diff(np.concatenate((starts, [len(values)])))


def level_between(values: Floats) -> float:
    """The noise that second differences of a smooth motion leave, robustly; a rough upper limit.

    The variance of x(n-1) - 2 x(n) + x(n+1) of white noise is six times its own.
    """
    if len(values) < _FEWEST_RUNS:
        return 0.0
    second = np.diff(values, 2)
    width = float(np.median(np.abs(second - np.median(second))))
    return float(MAD_TO_SIGMA * width / np.sqrt(6.0))


# -- ends of a range --------------------------------------------------------------------------
# Readings that stay at exactly the largest or the smallest value: at the end of a range.

# Differences of this order leave next to nothing of a motion, and of white noise the root of the
# sum of their squared weights: 1, 4, 6, 4, 1.
_ORDER = 4
_GAIN = 70.0**0.5
# Equal readings in a row from which they stay, see _stays.
_FEWEST = 3
# Share of readings at one value from which that is where the column is mostly: its rest, or none.
_MOSTLY = 0.5
# The sharpest bend of a motion is at most so much sharper than the others. Halved, one in a few
# motions without noise has a sharper one; doubled, only a fast motion is seen to be cut off.
_AS_BENT = 2.0
# What a play, a lag or a lost motion leaves of a rest is as far off as what it leaves elsewhere.
# Halved, a rest beside a play is called an end; doubled, a range that is cut by little is missed.
_FAR_BEYOND = 2.0
# Share of the readings' range by which a fit is rounded.
_ROUNDED_SHARE = 1e-9


@dataclass(frozen=True)
class End:
    """The `largest` or the smallest value of a column, at which readings stay.

    `at` (n) marks all readings of it; `first` is the index where they stay for the first time.
    `certain`: the noise of the others excludes that it is a rest. `sharp`: so does the inertia of
    what is measured, as it comes to no other rest so suddenly.
    """

    value: float
    largest: bool
    at: NDArray[np.bool_]
    first: int
    certain: bool
    sharp: bool

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.at))

    def is_passed(self, values: Floats, expected: Floats | None) -> bool:
        """True if it is no rest: its noise says so, or what was `expected` (n,) goes on there.

        Without that (None) a sudden stop is none either.
        """
        if expected is None:
            return self.certain or self.sharp
        left = values - expected
        excess = float(np.median(left[self.at])) * (-1 if self.largest else 1)
        others = left[~self.at]
        far = _FAR_BEYOND * float(np.abs(others).max()) + _ROUNDED_SHARE * float(np.ptp(values))
        return excess > far or (self.certain and excess > float(np.sqrt(np.mean(others**2))))

    def words(self, unit: str) -> str:
        """`45 readings are exactly 10 V, the largest of all: at the end of its range?`"""
        which = "largest" if self.largest else "smallest"
        value = f"{self.value:.10g}{unit and ' '}{unit}"
        return (
            f"{self.count} readings are exactly {value}, the {which} of all: at the end of its"
            " range?"
        )


def ends_of(values: Floats) -> Iterator[End]:
    """The ends of a column (n, without NaN) at which at least three readings stay.

    A rest has noise, and where a converter hides it other rests repeat one value as well. So a run
    of equal readings is no rest if the others, which are more, show their noise and stay at no
    other value.
    """
    if not len(values):
        return
    at = {True: values == values.max(), False: values == values.min()}
    if not any(map(_stays, at.values())) or values.min() == values.max():
        return
    held = held_of(values)
    kept = slice(len(values) % held, None, held)
    longest = _longest_rest(values[kept])
    starts, lengths = runs_of(values[kept])
    most = {largest: np.where(own[kept][starts], lengths, 1) for largest, own in at.items()}
    elsewhere = int(np.where((most[True] == 1) & (most[False] == 1), lengths, 1).max())
    for largest, own in most.items():
        if own.max() >= _FEWEST:
            first = int(starts[int(np.argmax(own >= _FEWEST))]) * held + len(values) % held
            certain = bool(own.max() > longest >= elsewhere)
            sharp = _is_sharp(values[kept], at[largest][kept])
            some = bool(at[largest].mean() < _MOSTLY)
            value = float(values[first])
            yield End(value, largest, at[largest], first, some and certain, some and sharp)


def _stays(at: NDArray[np.bool_]) -> bool:
    return bool(np.any(at[2:] & at[1:-1] & at[:-2]))


def _is_sharp(values: Floats, at: NDArray[np.bool_]) -> bool:
    """True if the speed changes as nowhere else where readings come to stay `at` an end."""
    steps = np.diff(values)
    bends = np.abs(steps[2:] - steps[:-2])
    windows = np.convolve(at, np.ones(4, int), "valid")
    edges = (windows > 0) & (windows < 4)
    apart = windows == 0
    if not edges.any() or not apart.any():
        return False
    return bool(np.median(bends[edges]) > _AS_BENT * bends[apart].max())


def _longest_rest(values: Floats) -> float:
    """The longest run of equal readings that noise leaves by chance; infinite if none shows."""
    step, level = float(np.diff(distinct_of(values)).min(initial=np.inf)), _level(values)
    if level <= step:
        return np.inf
    # Two readings of one rest are equal with the density of their difference at 0, times the step.
    equal = max(step / (2 * np.sqrt(np.pi) * level), 1 / len(values))
    return float(2 + np.log(len(values) / STUCK_ALARM) / -np.log(equal))


def _level(values: Floats) -> float:
    """The noise between neighbours where readings change; 0 where they go on smoothly."""
    if len(values) <= _ORDER + 1:
        return 0.0
    bends = np.diff(values, _ORDER)
    equal = np.concatenate(([0], np.cumsum(np.diff(values) == 0)))
    changes = equal[_ORDER:] - equal[:-_ORDER] < _ORDER
    both = changes[1:] & changes[:-1]
    # Those of noise mostly change their sign from one to the next, those of a motion do not.
    if np.count_nonzero((bends[1:] * bends[:-1] < 0) & both) <= np.count_nonzero(both) / 2:
        return 0.0
    return float(MAD_TO_SIGMA * np.median(np.abs(bends[changes])) / _GAIN)
