"""Thins readings whose noise is below half a converter's step.

While the signal changes by less than a step, such readings repeat with the same rounding
error: a thousand of them are one independent sample, and least squares must not count more.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mopro.experiment.sawyer.trials import Experiment, Reading
from mopro.instruments.sensor import Sensor

# Noise as a share of a step, above which rounding errors are independent of each other.
_INDEPENDENT_STEPS = 0.5
# Share of the readings of a signal with such noise at which the change turns back. Of a smooth one
# without noise none does, and the share goes with the noise. Halved, noise of a fourth of a step
# is enough to read all; doubled, one of two steps.
_TURNED_BACK = 0.27
# Noise as a share of a step, above which a reading flickers between two steps.
_FLICKER_STEPS = 0.1
_SEED = 0


def thinned(experiment: Experiment) -> Experiment:
    """`experiment` with one sample for each stretch of equal ones, where rounding is no noise.

    Each sample gets seeded dither of one step, which makes its error independent of the
    signal; the sensor's noise is increased accordingly.
    """
    generator = np.random.default_rng(_SEED)
    trials = tuple(
        replace(trial, readings=tuple(_thinned(r, generator) for r in trial.readings))
        for trial in experiment.trials
    )
    return replace(experiment, trials=trials)


def _thinned(reading: Reading, generator: np.random.Generator) -> Reading:
    sensor = reading.sensor
    if sensor.noise_rms >= _INDEPENDENT_STEPS * sensor.adc_step or _is_noisy(reading):
        return reading
    rows = _middles(reading)
    dither = generator.uniform(-0.5, 0.5, len(rows)) * sensor.adc_step
    return Reading(_dithered(sensor), reading.time_s[rows], reading.values[rows] + dither)


def _is_noisy(reading: Reading) -> bool:
    """True if the readings turn back as often as noise of half a step has them do.

    The stated noise may be too small; stretches between changes would then be chosen by noise.
    """
    change = np.diff(reading.values)
    return len(change) > 1 and float(np.mean(change[1:] * change[:-1] < 0)) > _TURNED_BACK


def _middles(reading: Reading) -> list[int]:
    """Index of the middle of each stretch of equal samples, where the signal is nearest to them.

    A flicker between neighbouring steps does not end a stretch. The last sample always stays,
    as it states the duration of the run.
    """
    sensor, values = reading.sensor, reading.values.tolist()
    reach = (1.5 if sensor.noise_rms > _FLICKER_STEPS * sensor.adc_step else 0.5) * sensor.adc_step
    firsts = [0]
    for row, value in enumerate(values):
        if abs(value - values[firsts[-1]]) > reach:
            firsts.append(row)
    ends = [*firsts[1:], len(values)]
    middles = [(first + end - 1) // 2 for first, end in zip(firsts, ends, strict=True)]
    return sorted({*middles, len(values) - 1})


def _dithered(sensor: Sensor) -> Sensor:
    return replace(sensor, noise_rms=math.hypot(sensor.noise_rms, sensor.adc_step / math.sqrt(12)))
