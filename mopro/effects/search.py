"""Tools for searches: what of a residual looks like a line, a step or a delay.

A search is shown a `ResidualView`: the data, and what a fit leaves of them. These read its
residuals as positions in metres of the sensors of a `View`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.model import ResidualView
from mopro.effects.base import Floats, View

Values = Mapping[str, float]

_CONTRAST = 6.0
_FEWEST_FOR_SPEED = _FEWEST_FOR_A_STEP = 2


def residual_m(view: View, left: ResidualView, row: int) -> Floats:
    """The residual of series `row`, in metres."""
    metres: Floats = left.residuals[row] * left.sigmas[row]
    return metres * view.positions()[row][1].sensor.unit_si


def targets_m(view: View, left: ResidualView) -> dict[int, Floats]:
    """Where the target was at each sample of each series, whatever the transducer made of it."""
    places = view.targets(left.settings)
    return {
        row: places[row] * reading.sensor.unit_si for row, (_, reading) in view.positions().items()
    }


def sinusoid(angle: Floats, values: Floats) -> tuple[float, float]:
    """The sizes of sin(angle) and cos(angle) in `values` that fit best, a constant left free."""
    shapes = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(angle))])
    sine, cosine, _ = np.linalg.lstsq(shapes, values, rcond=None)[0]
    return float(sine), float(cosine)


def peaks(power: Floats) -> NDArray[np.intp]:
    """The indices of local maxima, the highest first."""
    inner = power[1:-1]
    found = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]))
    return found[np.argsort(power[found])[::-1]]


def lines_over_position(
    places_m: list[Floats], residuals: list[Floats], finest_m: float
) -> tuple[Floats, Floats]:
    """Cycles per metre and their power; see diagnosis.spectrum, which takes scipy to import."""
    from mopro.diagnosis.spectrum import position_spectrum

    return position_spectrum(places_m, residuals, finest_m)


def delay_s(view: View, left: ResidualView) -> tuple[float, float]:
    """By how much the data are late against the model (s), and its standard deviation."""
    lateness = strength = 0.0
    for row, (_, reading) in view.positions().items():
        if len(reading.time_s) < _FEWEST_FOR_SPEED:
            continue
        speed = np.gradient(left.predictions[row], reading.time_s) / left.sigmas[row]
        # The residual has lost its mean to the offset.
        speed -= speed.mean()
        lateness -= float(speed @ left.residuals[row])
        strength += float(speed @ speed)
    return lateness / max(strength, 1e-300), 1 / math.sqrt(max(strength, 1e-300))


def step(z: Floats, metres: Floats, time_s: Floats) -> tuple[float, float, float] | None:
    """The times before and after the step that divides the samples best, and its height (m).

    `z` are the residuals in standard deviations; None where no step shows in them.
    """
    from mopro.diagnosis.noise_tests import cusum_step  # loads scipy

    if len(z) < _FEWEST_FOR_A_STEP:
        return None
    at, contrast = cusum_step(z)
    if abs(contrast) < _CONTRAST:
        return None
    height = float(metres[at + 1 :].mean() - metres[: at + 1].mean())
    return float(time_s[at]), float(time_s[at + 1]), height
