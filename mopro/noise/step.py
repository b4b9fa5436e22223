"""Step of a converter (quantisation), found from the set of distinct readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

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
