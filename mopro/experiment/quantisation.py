"""Thins readings whose noise is below half a converter's step.

While the signal changes by less than a step, such readings repeat with the same rounding
error: a thousand of them are one independent sample, and least squares must not count more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mopro.engine.series import Floats

# Noise as a share of a step, above which rounding errors are independent of each other.
_INDEPENDENT_STEPS = 0.5
# Share of the readings of a signal with such noise at which the change turns back. Of a smooth one
# without noise none does, and the share goes with the noise. Halved, noise of a fourth of a step
# is enough to read all; doubled, one of two steps.
_TURNED_BACK = 0.27
# Noise as a share of a step, above which a reading flickers between two steps.
_FLICKER_STEPS = 0.1
SEED = 0


class Thinned(NamedTuple):
    """Those of the samples (n) that stay: their indices and their dithered values (m)."""

    kept: NDArray[np.intp]
    values: Floats


def thinned(
    values: Floats, step: float, noise: float | None, generator: np.random.Generator
) -> Thinned | None:
    """One sample for each stretch of equal readings `values` (n), or None if rounding is noise.

    `step` and `noise` (RMS, without rounding; None where it is unknown) in their unit. Each sample
    gets dither of one step, which makes its error independent of the signal: the error grows to
    that of `dithered`.
    """
    # The stated noise may be too small; stretches between changes would then be chosen by noise.
    shown = _apparent(values) * step
    noise = shown if noise is None else noise
    if max(noise, shown) >= _INDEPENDENT_STEPS * step:
        return None
    rows = _middles(values, (1.5 if noise > _FLICKER_STEPS * step else 0.5) * step)
    return Thinned(rows, values[rows] + generator.uniform(-0.5, 0.5, len(rows)) * step)


def dithered(rms: float, step: float) -> float:
    """Standard deviation of readings of deviation `rms` with dither of one `step`."""
    return float(np.hypot(rms, step / np.sqrt(12)))


def _apparent(values: Floats) -> float:
    """The noise, in steps, that has readings turn back as often as these do."""
    change = np.diff(values)
    turned = np.mean(change[1:] * change[:-1] < 0) if len(change) > 1 else 0.0
    return _INDEPENDENT_STEPS * float(turned) / _TURNED_BACK


def _middles(values: Floats, reach: float) -> NDArray[np.intp]:
    """Index of the middle of each stretch of equal samples, where the signal is nearest to them.

    A flicker within `reach` does not end a stretch. The last sample always stays, as it states the
    duration of the run.
    """
    firsts, first = [0], float(values[0])
    for row, value in enumerate(values.tolist()):
        if abs(value - first) > reach:
            firsts.append(row)
            first = value
    ends = [*firsts[1:], len(values)]
    middles = [(first + end - 1) // 2 for first, end in zip(firsts, ends, strict=True)]
    return np.array(sorted({*middles, len(values) - 1}), dtype=np.intp)
