"""Lines over position: the periodogram of samples that are not evenly spaced."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft

from mopro.diagnosis.model import Floats

# Bins this much finer than the finest period leave its amplitude whole.
_BINS_PER_PERIOD = 8
_OVERSAMPLED = 2
_MOST_BINS = 1 << 20
_DEFAULT_LINES = 4000


def position_spectrum(
    positions: Sequence[Floats], residuals: Sequence[Floats], finest: float | None = None
) -> tuple[Floats, Floats]:
    """Cycles per unit of position, and the power there summed over the runs.

    Each run's power is |Σ z exp(i q x)|²/n: 1 on the mean for white noise of variance 1,
    so that a sum over runs needs no common phase. `finest` is the shortest period looked
    for (a few thousand lines unless given); a way too short for it has no lines. Samples
    are gathered in fine bins first.
    """
    low = min(float(x.min()) for x in positions)
    reach = max(float(x.max()) for x in positions) - low
    finest = finest or reach / _DEFAULT_LINES
    bins = min(_MOST_BINS, int(np.ceil(_BINS_PER_PERIOD * reach / finest)) + 1)
    length = fft.next_fast_len(_OVERSAMPLED * bins)
    width = reach / (bins - 1)
    lines = max(int(length * width / finest), 1)
    power = np.zeros(lines - 1)
    for x, z in zip(positions, residuals, strict=True):
        place = np.rint((x - low) / width).astype(int)
        gathered = np.bincount(place, z - z.mean(), bins)
        power += np.abs(fft.rfft(gathered, length)[1:lines]) ** 2 / len(z)
    return np.arange(1, lines) / (length * width), power
