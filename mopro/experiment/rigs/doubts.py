"""Doubts about a sensor's sign and scale: readings that a known factor would make fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mopro.diagnosis import Series
from mopro.formula.evaluate import Floats
from mopro.rig.base import BaseFit, fitted_base, slope_of
from mopro.rig.model import AXIS
from mopro.rig.simulation import START, Model

# Factors by which a reading may be off, and what they stand for.
_KNOWN: dict[float, str] = {
    180 / math.pi: "degrees are taken for radians",
    math.pi / 180: "radians are taken for degrees",
    25.4: "millimetres are taken for inches",
    1 / 25.4: "inches are taken for millimetres",
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
# A free motion that fits to this share is not doubted; another scale must leave so much less.
_POOR, _BETTER = 0.3, 0.5


def check_scales(model: Model, data: Sequence[Series], base: BaseFit) -> None:
    """ModelError for a sensor whose readings another sign or a known factor makes fit.

    A sensor of free scale is not doubted.
    """
    predicted = model(base.settings)
    for nth, ((_, reading), own) in enumerate(zip(model.readings, predicted, strict=True)):
        sensor = reading.sensor
        if sensor.scale is None or sensor.value is None or model.rig.kind == "python":
            continue
        factor = _of_line(data[nth], own) or _of_free_motion(model, data, base, nth)
        if factor is None:
            continue
        sign = "of the other sign" if factor < 0 else "of the stated sign"
        known = _KNOWN.get(abs(factor), "")
        what = f"{sign}, and {abs(factor):.4g} times as large ({known})" if known else sign
        scale = f", or scale = {abs(factor):.6g}" if known else ""
        way = ' sign = -1 or "free"' if factor < 0 else ' unit, or scale = "free"'
        hint = f"if that is so, state the{way}{scale} of the sensor"
        message = f"{sensor.name}: the readings of {data[nth].run} are as simulated if they are {what}"
        raise sensor.value["column"].error(message, "wrong-scale", hint)


def _of_line(series: Series, predicted: Floats) -> float | None:
    """The known factor, or the sign, by which the readings are off the simulated ones."""
    shapes = series.nuisance_shapes()
    measured, simulated = (_apart(shapes, values) for values in (series.values, predicted))
    power = float(measured @ measured)
    slope = slope_of(measured, simulated)
    if not math.isfinite(slope) or not power:
        return None
    left = measured - slope * simulated
    stated = measured - simulated
    if left @ left > (1 - _EXPLAINED) * power or stated @ stated < _LEFT * power * min(1, slope**-2):
        return None
    return _named(slope)


def _named(slope: float) -> float | None:
    near = [f for f in (*_KNOWN, 1.0) if abs(math.log(abs(slope) / f)) < _NEAR]
    if not near:
        return None
    factor = min(near, key=lambda f: abs(math.log(abs(slope) / f)))
    return None if factor == 1.0 and slope > 0 else math.copysign(factor, slope)


def _apart(shapes: Floats, values: Floats) -> Floats:
    if not shapes.shape[1]:
        return values
    found: Floats = values - shapes @ np.linalg.lstsq(shapes, values, rcond=None)[0]
    return found


def _of_free_motion(
    model: Model, data: Sequence[Series], base: BaseFit, nth: int
) -> float | None:
    """The known factor that makes a motion fit whose start is free and follows the readings."""
    run, _ = model.readings[nth]
    free = {START.format(run.name, state) for state in model.states}
    if model.rig.kind != AXIS or not free & {p.name for p in base.parameters} or len(data) > 1:
        return None
    stated = _share_left(model, data, base, 1.0, nth)
    if stated < _POOR:
        return None
    shares = {f: _share_left(model, data, base, f, nth) for f in (180 / math.pi, math.pi / 180)}
    best = min(shares, key=lambda f: shares[f])
    return best if shares[best] < _BETTER * stated else None


def _share_left(
    model: Model, data: Sequence[Series], base: BaseFit, factor: float, nth: int
) -> float:
    """Share of a series that the fitted model leaves, if its readings were `factor` too large."""
    from dataclasses import replace

    scaled = [
        replace(s, values=s.values / factor, sigma=None) if i == nth else s
        for i, s in enumerate(data)
    ]
    names = {START.format(model.readings[nth][0].name, state) for state in model.states}
    parameters = [
        replace(p, low=p.low / factor, high=p.high / factor, starts=(p.starts[0] / factor,))
        if p.name in names else p
        for p in base.parameters
    ]  # fmt: skip
    fit = fitted_base(model, scaled, parameters)
    own = _apart(scaled[nth].nuisance_shapes(), scaled[nth].values - model(fit.settings)[nth])
    whole = _apart(scaled[nth].nuisance_shapes(), scaled[nth].values)
    share = float(np.nan_to_num(own, nan=1e9) @ np.nan_to_num(own, nan=1e9)) / float(whole @ whole)
    return share


__all__ = ["check_scales"]
