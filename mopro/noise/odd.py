"""Readings that are not noise: outliers, stuck stretches, values held between updates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Floats = NDArray[np.float64]
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
    limit = float(stats.norm.isf(_FALSE_ALARM / (2 * len(values)))) * max(width, 1e-300)
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
