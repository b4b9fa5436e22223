"""Tools that find starting values: spectral lines, steps and delays in a residual.

They take a `ResidualView` (the data and the residuals of a fit), and convert its residuals to
metres by the sensors of a `View`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.effects.effect import Floats, View
from mopro.engine.candidate import ResidualView
from mopro.machine.constants import PlantConstants

Values = Mapping[str, float]

# Least contrast of a step, in standard deviations.
_STEP_SIGMAS = 6.0
# Periods in the longest travel below which a line is a bend.
FEWEST_PERIODS = 2.0
_FEWEST_FOR_SPEED = _FEWEST_FOR_A_STEP = 2


def residual_m(view: View, fit: ResidualView, row: int) -> Floats:
    """The residual of series `row`, in metres."""
    return np.asarray(fit.residuals[row] * _sigma_m(view, fit, row))


def _sigma_m(view: View, fit: ResidualView, row: int) -> float:
    """Standard deviation of the noise of series `row`, in metres."""
    return fit.sigmas[row] * view.positions()[row][1].sensor.unit_si


def force_N(view: View, fit: ResidualView, row: int) -> Floats:
    """The force (N) that the residual of series `row` calls for, at each sample.

    Near its setpoint the motor is a mass on the spring and the damper of its drive, which answers
    with H = 1 / (K - m ω² + i c ω). The force is H* R / (|H|² + N/S), where N is the power of the
    sensor's noise and S that of a white force which, with it, has the power of the residual R
    (Wiener 1949).
    """
    run, reading = view.positions()[row]
    residual, length = residual_m(view, fit, row), 2 * len(reading.time_s)
    step_s = float(np.median(np.diff(reading.time_s)))
    plant = PlantConstants.of(view.machine, view.runs[run].payload_kg)
    omega = 2 * np.pi * np.fft.rfftfreq(length, step_s)
    stiffness = plant.pull_out_force_N * plant.wave_number_1_m
    answer = 1 / (stiffness - plant.mass_kg * omega**2 + 1j * plant.damping_N_s_m * omega)
    transform = np.fft.rfft(residual, length)
    noise_power = len(residual) * _sigma_m(view, fit, row) ** 2
    beyond = max(float(np.sum(np.abs(transform) ** 2)) - len(omega) * noise_power, noise_power)
    force_power = beyond / float(np.sum(np.abs(answer) ** 2))
    force = transform * answer.conj() / (np.abs(answer) ** 2 + noise_power / force_power)
    return np.asarray(np.fft.irfft(force, length)[: len(residual)])


def targets_m(view: View, fit: ResidualView) -> dict[int, Floats]:
    """Predicted position (m) of the sensor's target at each sample, by series number."""
    places = view.targets(fit.settings)
    return {
        row: places[row] * reading.sensor.unit_si for row, (_, reading) in view.positions().items()
    }


def peaks(power: Floats) -> NDArray[np.intp]:
    """The indices of local maxima, the highest first."""
    inner = power[1:-1]
    indices = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]))
    return indices[np.argsort(power[indices])[::-1]]


def lines_over_position(
    places_m: list[Floats], residuals: list[Floats], finest_m: float
) -> tuple[Floats, Floats]:
    """Cycles per metre and their power; see diagnosis.spectrum."""
    from mopro.engine.spectrum import position_spectrum

    return position_spectrum(places_m, residuals, finest_m)


def strongest_lines(
    view: View,
    fit: ResidualView,
    finest_m: float,
    most: int,
    of: Callable[[View, ResidualView, int], Floats] = residual_m,
) -> Iterator[tuple[float, float, float]]:
    """Sine, cosine and period (m) of the `most` strongest lines over place, of the residual (m).

    Or of what else `of` makes of the residual of a series, in its unit. A line has two periods at
    least in the longest travel, and a period above `finest_m`.
    """
    from mopro.engine.spectrum import sinusoid

    targets = targets_m(view, fit)
    rows = [row for row, place in targets.items() if np.ptp(place) > 0]
    if not rows:
        return
    places = [targets[row] for row in rows]
    values = [of(view, fit, row) for row in rows]
    weighted = [own / _sigma_m(view, fit, row) for own, row in zip(values, rows, strict=True)]
    cycles, power = lines_over_position(places, weighted, finest_m)
    power[cycles * max(float(np.ptp(place)) for place in places) < FEWEST_PERIODS] = 0.0
    x, joined = np.concatenate(places), np.concatenate(values)
    for peak in peaks(power)[:most]:
        q = 2 * math.pi * float(cycles[peak])
        yield (*sinusoid(q * x, joined), 2 * math.pi / q)


def delay_s(view: View, fit: ResidualView) -> tuple[float, float]:
    """Delay of the data against the model (s) and its standard error (s)."""
    projection = information = 0.0
    for row, (_, reading) in view.positions().items():
        if len(reading.time_s) < _FEWEST_FOR_SPEED:
            continue
        speed = np.gradient(fit.predictions[row], reading.time_s) / fit.sigmas[row]
        # The fitted offset has taken the mean out of the residual.
        speed -= speed.mean()
        projection -= float(speed @ fit.residuals[row])
        information += float(speed @ speed)
    return projection / max(information, 1e-300), 1 / math.sqrt(max(information, 1e-300))


def step(z: Floats, metres: Floats, time_s: Floats) -> tuple[float, float, float] | None:
    """Sample times (s) before and after the most likely step, and its height (m).

    `z` are the residuals in standard deviations; None where the step is below _STEP_SIGMAS.
    """
    from mopro.engine.residuals import cusum_step  # loads scipy

    if len(z) < _FEWEST_FOR_A_STEP:
        return None
    at, contrast = cusum_step(z)
    if abs(contrast) < _STEP_SIGMAS:
        return None
    height = float(metres[at + 1 :].mean() - metres[: at + 1].mean())
    return float(time_s[at]), float(time_s[at + 1]), height
