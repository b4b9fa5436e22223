"""Wild samples: single ones, and short dropouts, that are far from their neighbours."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from mopro.diagnosis.constants import (
    FALSE_ALARMS,
    FEWEST,
    LEAST_SAMPLES,
    LEAST_SHARE,
    MAJORITY,
    TOLERANCE,
)
from mopro.diagnosis.model import Floats, Mask

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
    distances = np.abs(residual - (low + high) / 2)
    deviation = max(float(np.median(distances)) / _QUARTILE, least * _DEVIATION)
    limit = -float(special.ndtri(FALSE_ALARMS / (2 * len(residual)))) * deviation
    # Beside a step, half of the neighbours are as the sample is; on the peak of an oscillation they
    # differ among themselves, the extremes left out as one of them may be wild too.
    apart = np.abs(residual - np.clip(residual, low, high))
    spread = neighbours[:, -2] - neighbours[:, 1]
    single = (apart > limit) & (spread < apart)
    wild = single | _dropouts(residual, math.sqrt(2) * limit)
    return wild if deviation and wild.mean() < TOLERANCE else none


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
