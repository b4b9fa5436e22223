"""Noise of the inputs' measurement, as noise of the readings that a model makes of it.

Of white noise of standard deviation s in the rows of an input, readings have the covariance
s² J Jᵀ, J being their derivatives by those rows. J is taken along cosines of up to 256 half-waves a
run; what is faster does to a reading what noise that alternates from row to row does to it, and
counts as white noise of its sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from mopro.engine.series import Floats, Series, Settings
from mopro.stated.data import Run
from mopro.stated.rates import noise_of
from mopro.stated.simulation import Model

# Half-waves of noise in a run, at most: of 50,000 rows their responses take 100 MB a sensor.
_HALF_WAVES = 256
# Share of the variance of a sensor's noise from which on a term of an input's noise counts.
_SEEN = 0.01


@dataclass(frozen=True)
class InputNoise:
    """White noise of an input of a run, of standard deviation `rms` in SI."""

    run: str
    name: str
    rms: float


def stated_noise(model: Model) -> list[InputNoise]:
    """The noise of the inputs that the experiment states."""
    return [
        InputNoise(run.name, name, rms)
        for run in model.experiment.trials
        for name, rms in run.noise.items()
        if rms
    ]


def apparent_noise(model: Model) -> list[InputNoise]:
    """Noise of the inputs that no file states, as large as polynomials through seven rows leave.

    An input that is held is a command, which the machine gets as it is logged.
    """
    return [
        InputNoise(run.name, name, rms)
        for run in model.experiment.trials
        for name, values in run.inputs.items()
        if name not in {*run.noise, *run.held}
        and (rms := noise_of(run.time_s, values, resting=True)) > 0
    ]


def beside_input_noise(
    model: Model, settings: Settings, data: Sequence[Series], noises: Sequence[InputNoise]
) -> tuple[Series, ...]:
    """The series of all readings beside noise of inputs, by the model's response at `settings`."""
    found: list[Series] = []
    end = 0
    for run in model.experiment.trials:
        begin, end = end, end + len(run.readings)
        own = [noise for noise in noises if noise.run == run.name]
        found += _of_run(model, settings, run, data[begin:end], own) if own else data[begin:end]
    return tuple(found)


def _of_run(
    model: Model, settings: Settings, run: Run, data: Sequence[Series], noises: Sequence[InputNoise]
) -> Iterator[Series]:
    responses = [_response(model, settings, run, noise) for noise in noises]
    scales, columns = [], []
    for i, (reading, series) in enumerate(zip(run.readings, data, strict=True)):
        fast = math.hypot(*(own[i] for _, own in responses))
        sigma = reading.sensor.noise_rms
        scales.append(math.hypot(sigma, fast) if sigma else 1.0)
        slow = np.hstack([_slow(own[i], white[i]) for own, white in responses])
        columns.append(slow * series.counted[:, None] / scales[i])
    basis, sizes, _ = np.linalg.svd(np.vstack(columns), full_matrices=False)
    seen = sizes**2 > _SEEN
    if not seen.any():
        yield from data
        return
    terms = np.split(basis[:, seen] * sizes[seen], np.cumsum([len(s) for s in data])[:-1])
    for series, own, scale in zip(data, terms, scales, strict=True):
        yield replace(series, sigma=series.sigma and scale, of_inputs=own * scale)


def _slow(columns: Floats, fast: float) -> Floats:
    """Responses to cosines (samples x cosines) less the share that fast noise has in them too."""
    power = np.sum(columns**2, axis=0)
    left = np.maximum(power - fast**2, 0.0)
    share: Floats = np.sqrt(np.divide(left, power, out=np.zeros_like(power), where=power > 0))
    return columns * share


def _response(
    model: Model, settings: Settings, run: Run, noise: InputNoise
) -> tuple[list[Floats], list[float]]:
    """Responses of each reading to cosines (samples x cosines), and rms of one to fast noise."""
    rows = len(run.time_s)
    waves = fft.idct(np.eye(rows, min(rows, _HALF_WAVES)), axis=0, norm="ortho")
    still = model.varied(run, settings, noise.name, np.zeros(rows))
    changed = [model.varied(run, settings, noise.name, noise.rms * wave) for wave in waves.T]
    turns = noise.rms * np.where(np.arange(rows) % 2, -1.0, 1.0)
    fast = model.varied(run, settings, noise.name, turns)
    slow = [
        np.column_stack([np.nan_to_num(own[i] - at) for own in changed])
        for i, at in enumerate(still)
    ]
    return slow, [
        math.sqrt(float(np.mean(np.nan_to_num(own - at) ** 2)))
        for own, at in zip(fast, still, strict=True)
    ]
