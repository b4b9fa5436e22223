"""Samples that decide nothing: wild ones, short dropouts, and readings that a sensor repeats."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from mopro.assumed import FALSE_ALARMS, FEWEST, LEAST_SAMPLES, LEAST_SHARE, MAJORITY, TOLERANCE
from mopro.series import Floats, Mask

# Standard deviation of the distance of a sample from the median of its 2 FEWEST neighbours, for
# white noise of variance 1: the variance of a median is π/2 that of a mean.
_DEVIATION = math.sqrt(1 + math.pi / 2 / (2 * FEWEST))
# Median of |z| for a standard normal number z.
_QUARTILE = float(special.ndtri(0.75))


def wild_samples(residual: Floats, least: float) -> Mask:
    """The samples of one series that are further from their neighbours than noise allows.

    Of noise alone, one series in a thousand has any. The standard deviation of the noise is taken
    from the median distance, and is `least` where that is more. None where they are more than a
    few, or the series shows no noise: a shape is not made of wild samples.
    """
    none = np.zeros(len(residual), dtype=bool)
    if len(residual) < LEAST_SAMPLES:
        return none
    neighbours = _neighbours(residual)
    low, high = neighbours[:, FEWEST - 1], neighbours[:, FEWEST]
    limit = _limit(residual, (low + high) / 2, least)
    # Beside a step, half of the neighbours are as the sample is; on the peak of an oscillation they
    # differ among themselves, the extremes left out as one of them may be wild too.
    apart = np.abs(residual - np.clip(residual, low, high))
    spread = neighbours[:, -2] - neighbours[:, 1]
    single = (apart > limit) & (spread < apart)
    wild = single | _dropouts(residual, math.sqrt(2) * limit)
    return wild if limit and wild.mean() < TOLERANCE else none


def repeated_samples(values: Floats, residual: Floats, least: float) -> Mask:
    """The samples of one series at which the sensor repeats a reading while the axis moves.

    The run of equal `values` is longer than one in a thousand series has by chance, as often as
    neighbours are equal elsewhere, and the `residual` moves in all of it together by more than
    noise: of a coarse sensor, readings at rest are equal as well. None where every other reading
    is repeated, or a tenth of the series would be left out.
    """
    none = np.zeros(len(values), dtype=bool)
    first = np.flatnonzero(np.r_[True, np.diff(values) != 0])
    lengths = np.diff(np.r_[first, len(values)])
    longest = int(lengths.max())
    others = len(values) - longest
    if len(values) < LEAST_SAMPLES or not others:
        return none
    share = max((others - len(first) + 1) / others, 1 / len(values))
    if share >= MAJORITY:
        return none
    by_chance = 1 + math.log(FALSE_ALARMS / len(values)) / math.log(share)
    neighbours = _neighbours(residual)
    middle = (neighbours[:, FEWEST - 1] + neighbours[:, FEWEST]) / 2
    limit = math.sqrt(2) * _limit(residual, middle, least)
    repeated = none.copy()
    for at, length in zip(first.tolist(), lengths.tolist(), strict=True):
        moved = residual[at : at + length] - residual[at]
        if length > by_chance and np.linalg.norm(moved) > limit:
            # A reading is where the axis was when it was taken, unless the sensor jumped to it.
            jumped = at > 0 and abs(residual[at] - residual[at - 1]) > limit
            repeated[at + (not jumped) : at + length] = True
    return repeated if limit and repeated.mean() < LEAST_SHARE else none


def _limit(residual: Floats, middle: Floats, least: float) -> float:
    """Distance from the `middle` of its neighbours that noise exceeds in one series of a thousand.

    0 where the series shows no noise.
    """
    deviation = float(np.median(np.abs(residual - middle))) / _QUARTILE
    return -float(special.ndtri(FALSE_ALARMS / (2 * len(residual)))) * max(
        deviation, least * _DEVIATION
    )


def _neighbours(residual: Floats) -> Floats:
    """Each sample's neighbours, three on either side, sorted (samples x 6).

    Beyond the ends the series goes on as it came: no first or last sample is wild.
    """
    padded = np.pad(residual, FEWEST, mode="reflect", reflect_type="odd")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * FEWEST + 1)
    return np.sort(np.delete(windows, FEWEST, axis=1), axis=1)


def _dropouts(residual: Floats, limit: float) -> Mask:
    """The samples between a jump and one that leads back, a hundredth of the series at most.

    A jump is a difference of two samples above `limit` that those beside it are not half of: an
    oscillation has none.
    """
    wild = np.zeros(len(residual), dtype=bool)
    change = np.diff(residual)
    size = np.abs(change)
    beside = np.maximum(np.r_[0.0, size[:-1]], np.r_[size[1:], 0.0])
    jumps = np.flatnonzero((size > limit) & (beside < MAJORITY * size))
    longest = LEAST_SHARE**2 * len(residual)
    for first, last in zip(jumps[:-1].tolist(), jumps[1:].tolist(), strict=True):
        leads_back = abs(change[first] + change[last]) < MAJORITY * size[first]
        if last - first <= longest and leads_back:
            wild[first + 1 : last + 1] = True
    return wild
