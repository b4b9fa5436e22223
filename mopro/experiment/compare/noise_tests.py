"""Residuals in standard deviations, and whether a series of them is noise."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from mopro.experiment.model import Floats
from mopro.instruments.sensor import Sensor

# Below this share of a step the noise is taken to be as large: a prediction is not exact.
_LEAST_NOISE = 0.03
# Beyond this many deviations the size says enough, and a tail's chance underflows.
_FAR = 5.0


def quantile_residual(
    measured: Floats, predicted: Floats, sensor: Sensor, generator: np.random.Generator
) -> Floats:
    """What the sensor's noise would have to be, in standard deviations.

    Without a converter that is (measured - predicted)/sigma. A converter rounds readings
    to steps; where the noise is smaller than a step the rounding is no noise, and repeats
    as the signal repeats. The chance of a lower reading, plus a random share of the
    chance of the same reading, is then evenly distributed, and its normal quantile is
    white (Dunn and Smyth 1996).
    """
    scaled = (measured - predicted) / sensor.sigma
    if not sensor.adc_step:
        return scaled
    noise = max(sensor.noise_rms, _LEAST_NOISE * sensor.adc_step)
    low = stats.norm.cdf((measured - sensor.adc_step / 2 - predicted) / noise)
    high = stats.norm.cdf((measured + sensor.adc_step / 2 - predicted) / noise)
    chance = low + generator.uniform(size=len(measured)) * (high - low)
    near = np.abs(scaled) < _FAR
    z: Floats = np.where(near, stats.norm.ppf(np.clip(chance, 1e-12, 1 - 1e-12)), scaled)
    return z


def size_chance(z: Floats, fitted: int = 0) -> float:
    """How often noise is as large (chi-squared); `fitted` numbers were taken from it."""
    return float(stats.chi2.sf(z @ z, max(len(z) - fitted, 1)))


def mean_chance(z: Floats) -> float:
    """How often the mean of noise is as far from zero."""
    return float(2 * stats.norm.sf(abs(float(z.sum())) / math.sqrt(len(z))))
