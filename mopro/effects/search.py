"""Tools that find starting values: spectral lines, steps and delays in a residual.

They take a `ResidualView` (the data and the residuals of a fit), and convert its residuals to
metres by the sensors of a `View`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.model import ResidualView
from mopro.effects.base import Floats, View

Values = Mapping[str, float]

# Least contrast of a step, in standard deviations.
_STEP_SIGMAS = 6.0
# Periods in the longest travel below which a line is a bend.
FEWEST_PERIODS = 2.0
_FEWEST_FOR_SPEED = _FEWEST_FOR_A_STEP = 2


def residual_m(view: View, fit: ResidualView, row: int) -> Floats:
    """The residual of series `row`, in metres."""
    metres: Floats = fit.residuals[row] * fit.sigmas[row]
    return metres * view.positions()[row][1].sensor.unit_si


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
    from mopro.diagnosis.spectrum import position_spectrum

    return position_spectrum(places_m, residuals, finest_m)


def strongest_lines(
    view: View, fit: ResidualView, finest_m: float, most: int
) -> Iterator[tuple[float, float, float]]:
    """Sine and cosine (m) and period (m) of the `most` strongest lines of the residual over place.

    A line has two periods at least in the longest travel, and a period above `finest_m`.
    """
    from mopro.diagnosis.spectrum import sinusoid

    targets = targets_m(view, fit)
    rows = [row for row, place in targets.items() if np.ptp(place) > 0]
    if not rows:
        return
    places = [targets[row] for row in rows]
    cycles, power = lines_over_position(places, [fit.residuals[row] for row in rows], finest_m)
    power[cycles * max(float(np.ptp(place)) for place in places) < FEWEST_PERIODS] = 0.0
    x = np.concatenate(places)
    residual = np.concatenate([residual_m(view, fit, row) for row in rows])
    for peak in peaks(power)[:most]:
        q = 2 * math.pi * float(cycles[peak])
        yield (*sinusoid(q * x, residual), 2 * math.pi / q)


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
    from mopro.diagnosis.noise_tests import cusum_step  # loads scipy

    if len(z) < _FEWEST_FOR_A_STEP:
        return None
    at, contrast = cusum_step(z)
    if abs(contrast) < _STEP_SIGMAS:
        return None
    height = float(metres[at + 1 :].mean() - metres[: at + 1].mean())
    return float(time_s[at]), float(time_s[at + 1]), height
