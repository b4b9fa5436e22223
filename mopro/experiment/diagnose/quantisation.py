"""Readings whose noise is less than a converter's step: what of them is news.

Such a reading repeats as the signal stands still, and its rounding repeats with it: a
thousand of them tell no more than one, and are no noise that least squares could weigh.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mopro.experiment.model import Experiment, Reading
from mopro.instruments.sensor import Sensor

# More noise than this share of a step makes the rounding a noise of its own.
_ENOUGH = 0.5
# So much makes a reading flicker between two steps now and then.
_FLICKERS = 0.1
_SEED = 0


def thinned(experiment: Experiment) -> Experiment:
    """`experiment` with one reading of each stretch of equal ones, where rounding is no noise.

    Each gets dither as large as the rounding (seeded), which leaves no pattern in what is left
    of it, and the noise of both.
    """
    generator = np.random.default_rng(_SEED)
    trials = tuple(
        replace(trial, readings=tuple(_thinned(r, generator) for r in trial.readings))
        for trial in experiment.trials
    )
    return replace(experiment, trials=trials)


def _thinned(reading: Reading, generator: np.random.Generator) -> Reading:
    sensor = reading.sensor
    if sensor.noise_rms >= _ENOUGH * sensor.adc_step:
        return reading
    rows = _middles(reading)
    dither = generator.uniform(-0.5, 0.5, len(rows)) * sensor.adc_step
    return Reading(_dithered(sensor), reading.time_s[rows], reading.values[rows] + dither)


def _middles(reading: Reading) -> list[int]:
    """The middle of each stretch of equal readings, where the signal is nearest to them.

    With some noise a reading flickers between neighbours while the signal stands, which ends
    no stretch. The very last reading stays, as a run goes on to there.
    """
    sensor, values = reading.sensor, reading.values.tolist()
    reach = (1.5 if sensor.noise_rms > _FLICKERS * sensor.adc_step else 0.5) * sensor.adc_step
    firsts = [0]
    for row, value in enumerate(values):
        if abs(value - values[firsts[-1]]) > reach:
            firsts.append(row)
    ends = [*firsts[1:], len(values)]
    middles = [(first + end - 1) // 2 for first, end in zip(firsts, ends, strict=True)]
    return sorted({*middles, len(values) - 1})


def _dithered(sensor: Sensor) -> Sensor:
    return replace(sensor, noise_rms=math.hypot(sensor.noise_rms, sensor.adc_step / math.sqrt(12)))
