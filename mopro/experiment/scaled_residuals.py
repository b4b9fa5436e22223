"""Residuals in standard deviations, and tests of their size and mean."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import special

from mopro.engine.assumed import TOLERANCE
from mopro.engine.residuals import difference_variance, without_wild
from mopro.engine.series import Floats, Series
from mopro.instruments.sensor import Sensor

# Share of a converter's step that the noise is at least taken for: a prediction is not exact.
_LEAST_NOISE_STEPS = 0.03
# In σ: beyond it the scaled residual is used, as the tail probability underflows.
_TAIL_SIGMAS = 5.0


def quantile_residual(
    measured: Floats, predicted: Floats, sensor: Sensor, generator: np.random.Generator
) -> Floats:
    """Residual in standard deviations, of unit normal distribution if the model holds.

    Without a converter: (measured - predicted)/sigma. A converter of step q rounds, and
    where the noise is smaller than q the rounding error repeats with the signal. Then the
    randomised quantile residual of Dunn and Smyth (1996) is taken: the normal quantile of
    P(reading lower) + u P(reading the same), with u uniform in 0..1 from `generator`.
    """
    scaled = (measured - predicted) / sensor.sigma
    if not sensor.adc_step:
        return scaled
    noise = max(sensor.noise_rms, _LEAST_NOISE_STEPS * sensor.adc_step)
    low = special.ndtr((measured - sensor.adc_step / 2 - predicted) / noise)
    high = special.ndtr((measured + sensor.adc_step / 2 - predicted) / noise)
    probability = low + generator.uniform(size=len(measured)) * (high - low)
    near = np.abs(scaled) < _TAIL_SIGMAS
    z: Floats = np.where(near, special.ndtri(np.clip(probability, 1e-12, 1 - 1e-12)), scaled)
    return z


def chi2_p(z: Floats, fitted: int = 0) -> float:
    """P-value of χ² = z·z with len(z) - `fitted` degrees of freedom."""
    return float(special.chdtrc(max(len(z) - fitted, 1), z @ z))


def mean_p(z: Floats) -> float:
    """Two-sided p-value of a zero mean of `z`."""
    return float(2 * special.ndtr(-abs(float(z.sum())) / math.sqrt(len(z))))


def without_wild_samples(
    data: Sequence[Series], left: Sequence[Floats]
) -> tuple[list[Series], tuple[str, ...]]:
    """The series without their wild and repeated samples, by what is `left` of them, and notes.

    Rows of a table have no neighbours that a wild one could differ from.
    """
    parts = [
        (series, list[str]()) if series.time_s is None else without_wild(series, own)
        for series, own in zip(data, left, strict=True)
    ]
    return [series for series, _ in parts], tuple(note for _, notes in parts for note in notes)


def larger_noise(data: Sequence[Series], z: Sequence[Floats]) -> list[float]:
    """Ratio of each series' noise, by differences of neighbouring samples, to the stated noise.

    `z`: what is left of each series in standard deviations. 1 where it is as stated, or unknown.
    """
    factors = [
        math.sqrt(difference_variance(own[series.counted]))
        if series.sigma and series.time_s is not None
        else 1.0
        for series, own in zip(data, z, strict=True)
    ]
    return [factor if factor > 1 + TOLERANCE else 1.0 for factor in factors]


def noise_notes(data: Sequence[Series], factors: Sequence[float]) -> Iterator[str]:
    """A note on each series whose noise is not as stated."""
    for series, factor in zip(data, factors, strict=True):
        if factor != 1:
            yield (
                f"the noise of {series.sensor} in {series.run} is {factor:.2g} times as much as "
                "stated, and white"
            )
