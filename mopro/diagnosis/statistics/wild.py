"""Wild samples: single ones that are far from their neighbours."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from mopro.diagnosis.constants import FALSE_ALARMS, FEWEST, LEAST_SAMPLES, LEAST_SHARE
from mopro.diagnosis.model import Floats, Mask

# Standard deviation of the distance of a sample from the median of its 2 FEWEST neighbours, for
# white noise of variance 1: the variance of a median is π/2 that of a mean.
_DEVIATION = math.sqrt(1 + math.pi / 2 / (2 * FEWEST))
# Median of |z| for a standard normal number z.
_QUARTILE = float(special.ndtri(0.75))


def wild_samples(residual: Floats, least: float) -> Mask:
    """The samples of one series further from the median of their neighbours than noise allows.

    Of noise alone, one series in a thousand has any. The neighbours are three on either side. The
    standard deviation of the noise is taken from the median distance, and is `least` where that is
    more. None where they are more than a few, or the series shows no noise: a shape is not made of
    wild samples.
    """
    none = np.zeros(len(residual), dtype=bool)
    if len(residual) < LEAST_SAMPLES:
        return none
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(residual, FEWEST, mode="reflect"), 2 * FEWEST + 1
    )
    neighbours = np.sort(np.delete(windows, FEWEST, axis=1), axis=1)
    low, high = neighbours[:, FEWEST - 1], neighbours[:, FEWEST]
    distances = np.abs(residual - (low + high) / 2)
    deviation = max(float(np.median(distances)) / _QUARTILE, least * _DEVIATION)
    limit = -float(special.ndtri(FALSE_ALARMS / (2 * len(residual)))) * deviation
    # Beside a step, half of the neighbours are as the sample is.
    wild = np.abs(residual - np.clip(residual, low, high)) > limit
    return wild if deviation and wild.mean() < LEAST_SHARE**2 else none
