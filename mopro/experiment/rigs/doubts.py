"""Doubts about a sensor's sign and scale: readings that a known factor would make fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mopro.diagnosis import Parameter, Series
from mopro.formula.evaluate import Floats
from mopro.instruments.slips import UNIT_SLIPS
from mopro.rig.base import BaseFit, fitted_base, slope_of
from mopro.rig.model import KINEMATIC
from mopro.rig.simulation import START, Model

# Factors by which a reading may be off, and what they stand for.
_KNOWN: dict[float, str] = {
    **{factor: f"{own} are taken for {other}" for factor, (own, other) in UNIT_SLIPS.items()},
    10.0: "a factor of 10",
    0.1: "a factor of 1/10",
    100.0: "a factor of 100",
    0.01: "a factor of 1/100",
    1000.0: "a factor of 1000, such as mm for m",
    1e-3: "a factor of 1/1000, such as m for mm",
    5.0: "a factor of 5",
    0.2: "a factor of 1/5",
    2.0: "a factor of 2, such as a radius for a diameter",
    0.5: "a factor of 1/2, such as a diameter for a radius",
}
# Share of the variance that a straight line of measured against simulated must explain, share of
# it that it must leave unexplained at the stated scale, and nearness of a slope to a factor.
_EXPLAINED, _LEFT, _NEAR = 0.9, 0.5, 0.15
# Share of the variance that the stated scale must leave for another one to be tried, and to be
# refused; another scale must leave so much less.
_TRIED, _POOR, _BETTER = 0.02, 0.3, 0.3


def check_scales(model: Model, data: Sequence[Series], base: BaseFit) -> list[str]:
    """Notes on sensors whose readings another sign or a known factor makes fit better.

    ModelError if they hardly fit as they are stated. A sensor of free scale is not doubted.
    """
    predicted = model(base.settings)
    notes: dict[str, str] = {}
    for nth, ((_, reading), own) in enumerate(zip(model.readings, predicted, strict=True)):
        sensor = reading.sensor
        if sensor.scale is None or sensor.value is None or model.foreign or sensor.name in notes:
            continue
        factor, left = _of_line(data[nth], own), 1.0
        if factor is None:
            factor, left = _of_fits(model, data, base, nth)
        if factor is None:
            continue
        message = f"{sensor.name}: {_words(data[nth], factor)}"
        if left >= _POOR:
            raise sensor.value["column"].error(message, "wrong-scale", _hint(factor))
        notes[sensor.name] = f"{message}: {_hint(factor)}"
    return list(notes.values())


def _words(series: Series, factor: float) -> str:
    sign = "of the other sign" if factor < 0 else ""
    known = _KNOWN.get(abs(factor))
    size = f"{abs(factor):.4g} times too large ({known})" if known else ""
    what = " and ".join(part for part in (sign, size) if part)
    return f"the readings of {series.run} are as simulated if they are {what}"


def _hint(factor: float) -> str:
    scale = f", or scale = {abs(factor):.6g}" if abs(factor) != 1 else ""
    way = 'sign = -1 or "free"' if factor < 0 else 'the unit as it is, scale = "free"'
    return f"if that is so, state {way}{scale} in the sensor"


def _of_line(series: Series, predicted: Floats) -> float | None:
    """The known factor, or the sign, by which the readings are off the simulated ones."""
    measured, simulated = map(series.without_nuisances, (series.values, predicted))
    power = float(measured @ measured)
    slope = slope_of(measured, simulated)
    if not math.isfinite(slope) or not power:
        return None
    left = measured - slope * simulated
    stated = measured - simulated
    if left @ left > (1 - _EXPLAINED) * power or stated @ stated < _LEFT * power * min(
        1, slope**-2
    ):
        return None
    return _named(slope)


def _named(slope: float) -> float | None:
    near = [f for f in (*_KNOWN, 1.0) if abs(math.log(abs(slope) / f)) < _NEAR]
    if not near:
        return None
    factor = min(near, key=lambda f: abs(math.log(abs(slope) / f)))
    return None if factor == 1.0 and slope > 0 else math.copysign(factor, slope)


def _of_fits(
    model: Model, data: Sequence[Series], base: BaseFit, nth: int
) -> tuple[float | None, float]:
    """The known factor, or the sign, with which the model fits much better, and what is left now.

    For a model of free numbers or of a free start, which follow the readings.
    """
    if not base.parameters or model.rig.kind == KINEMATIC:
        return None, 0.0
    stated = _share_left(model, data, base, 1.0, nth)
    if stated < _TRIED:
        return None, stated
    # A wrong law may fit a little better at half or twice the scale.
    tried = (-1.0, *(f for f in _KNOWN if not 0.5 <= f <= 2.0))
    shares = {f: _share_left(model, data, base, f, nth) for f in tried}
    best = min(shares, key=lambda f: shares[f])
    fits = shares[best] < _BETTER * min(stated, 1.0)
    return (best if fits else None), stated


def _share_left(
    model: Model, data: Sequence[Series], base: BaseFit, factor: float, nth: int
) -> float:
    """Share of a series that the fitted model leaves, if its readings were `factor` too large."""
    scaled = [
        replace(s, values=s.values / factor, sigma=None) if i == nth else s
        for i, s in enumerate(data)
    ]
    names = {START.format(model.readings[nth][0].name, state) for state in model.states}
    parameters = [_scaled(p, factor) if p.name in names else p for p in base.parameters]
    fit = fitted_base(model, scaled, parameters, at_once=True)
    own = scaled[nth]
    left = own.without_nuisances(np.nan_to_num(own.values - model(fit.settings)[nth], nan=1e9))
    whole = own.without_nuisances(own.values)
    return float(left @ left) / (float(whole @ whole) or 1.0)


def _scaled(p: Parameter, factor: float) -> Parameter:
    """A free start as readings that are `factor` too large have it."""
    low, high = sorted((p.low / factor, p.high / factor))
    return replace(p, low=low, high=high, starts=(p.starts[0] / factor,))
