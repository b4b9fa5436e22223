"""Sinusoids: periodogram over position, for samples that are not even, and a fit of one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft

from mopro.engine.series import Floats

# Bins for each finest period: 8 keep the amplitude of a line at that period to within 3 %
# (sinc of π/8). Halved, it loses 10 %.
_BINS_PER_PERIOD = 8
# The transform is this many times as long as the bins, so that a line between two frequencies
# loses little power.
_OVERSAMPLING = 2
# Memory: 16 MB for the transform of so many bins. Periods that they do not resolve are left out.
_MOST_BINS = 1 << 20
# Share of a step by which positions may be off a grid. Doubled, many a few positions are on one.
_OFF_GRID = 0.1
# Periods down to this fraction of the range of positions are looked at unless asked otherwise.
_DEFAULT_LINES = 4000


def position_spectrum(
    positions: Sequence[Floats],
    residuals: Sequence[Floats],
    finest: float | None = None,
    count: float = 0.0,
) -> tuple[Floats, Floats]:
    """Cycles per unit of position, or of time in its place, and the power at each over all runs.

    The power of a run is |Σ z exp(i q x)|²/n, whose mean is 1 for white noise of variance 1;
    a sum over runs needs no common phase. `finest`: the shortest period, in the unit of the
    positions (unless given the range over 4000, and at least two steps of positions on a grid,
    where a shorter one looks like a longer one), and at least two of `count`, the step of their
    sensor. Both arrays are empty where the range of the positions is shorter than that.
    """
    low = min(float(x.min()) for x in positions)
    reach = max(float(x.max()) for x in positions) - low
    finest = finest or max(reach / _DEFAULT_LINES, 2 * grid_step(np.concatenate(positions)))
    finest = max(finest, min(2 * count, reach))
    if reach < finest:
        return np.empty(0), np.empty(0)
    finest = max(finest, _BINS_PER_PERIOD * reach / _MOST_BINS)
    bins = int(np.ceil(_BINS_PER_PERIOD * reach / finest)) + 1
    length = fft.next_fast_len(_OVERSAMPLING * bins)
    width = reach / (bins - 1)
    lines = max(int(length * width / finest), 1)
    power = np.zeros(lines - 1)
    for x, z in zip(positions, residuals, strict=True):
        bin_of = np.rint((x - low) / width).astype(int)
        binned = np.bincount(bin_of, z - z.mean(), bins)
        power += np.abs(fft.rfft(binned, length)[1:lines]) ** 2 / len(z)
    return np.arange(1, lines) / (length * width), power


def grid_step(positions: Floats) -> float:
    """The step of the grid that all positions are on; 0 if they are on none."""
    steps = np.diff(np.sort(positions))
    largest = float(steps.max(initial=0.0))
    step = float(np.median(steps[steps > _OFF_GRID * largest])) if largest else 0.0
    multiples = (positions - positions.min()) / (step or 1.0)
    return step if np.all(np.abs(multiples - np.rint(multiples)) < _OFF_GRID) else 0.0


def sinusoid(angle: Floats, values: Floats) -> tuple[float, float]:
    """Least-squares coefficients of sin(angle) and cos(angle) in `values`, with a constant."""
    shapes = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(angle))])
    sine, cosine, _ = np.linalg.lstsq(shapes, values, rcond=None)[0]
    return float(sine), float(cosine)
