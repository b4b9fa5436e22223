"""Free numbers of a model - its own, starts of runs, scales of sensors - and their first fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from mopro.candidate import Parameter
from mopro.formula.evaluate import Floats
from mopro.residuals import Residuals
from mopro.rig.data import Reading, Run
from mopro.rig.model import AXIS, KINEMATIC, THERMAL
from mopro.rig.simulation import BASE, SCALE, START, Model
from mopro.series import Series, Settings

# Shares of each run that are fitted one after the other: an oscillation that is a cycle off at the
# end of a run is told by its beginning.
_SHARES = (0.1, 0.3, 1.0)
_MOST_CALLS = 60
# Steps of finite differences, as shares of the ranges. Fifty swings magnify a change.
DIFFERENCE = 1e-6
# Samples that the first position and speed are taken from, and multiples of what the data show
# within which a start is looked for.
_FIRST = 9
_REACH = 3.0
# Standard deviation of where a line through one reading and one twice as late leads back to, of
# readings with a deviation of 1.
_LED_BACK = math.sqrt(5.0)
# Reach (K) of the start of a node where the noise or the zero of its sensor is unknown: more than
# thermometers are off by. Halved, one that is off by 6 K is not reached; doubled, one by 20 K is.
_REACH_C = 10.0
# A free scale is looked for within this factor of where it starts.
_SCALE_REACH = 10.0


@dataclass(frozen=True)
class BaseFit:
    """Free numbers with the values that fit best without effects, as starts of a diagnosis."""

    parameters: tuple[Parameter, ...]

    @property
    def settings(self) -> Settings:
        return {BASE: {p.name: p.starts[0] for p in self.parameters}} if self.parameters else {}


def base_of(model: Model) -> list[Parameter]:
    """The free numbers of the model, from where the file or the data have them."""
    numbers = [
        Parameter(n.name, n.unit, n.low, n.high, (n.value,), difference=DIFFERENCE)
        for n in model.rig.numbers.values()
        if n.free
    ]
    starts = [p for run in model.experiment.trials for p in _starts(model, run)]
    return [*numbers, *starts, *_scales(model)]


def _starts(model: Model, run: Run) -> Iterator[Parameter]:
    """Free starts of the states of a run."""
    free = [state for state, at in run.start.items() if at is None]
    if model.rig.kind == KINEMATIC or not free:
        return
    if model.rig.kind == THERMAL:
        for state in free:
            yield _start(run, state, "C", *_first_temperature(run, state))
    if model.rig.kind == AXIS:
        x, v, reach_x, reach_v = _first_motion(run)
        rig = model.rig
        unit = {"x": rig.unit, "v": f"{rig.unit}/s"}
        for state, at, reach in (("x", x, reach_x), ("v", v, reach_v)):
            if state in free:
                yield _start(run, state, unit[state], at / rig.factor, reach / rig.factor)


def _start(run: Run, state: str, unit: str, at: float, reach: float) -> Parameter:
    name = START.format(run.name, state)
    return Parameter(name, unit, at - reach, at + reach, (at,), difference=DIFFERENCE)


def _first_temperature(run: Run, node: str) -> tuple[float, float]:
    """The first temperature (C) of a node by its sensor, and how far from there (K) it may be."""
    reading = next((r for r in run.readings if node in r.sensor.reads.formula.names), None)
    reading = reading or run.readings[0]
    sigma = reading.sensor.noise_rms if reading.sensor.zero is not None else None
    if not sigma:
        return reading.first, _REACH_C
    return reading.first, _REACH * sigma * (_LED_BACK if reading.first_is_wild else 1.0)


def _first_motion(run: Run) -> tuple[float, float, float, float]:
    """Position and speed at the first row as a position sensor shows them, and their reaches.

    In SI, as the start of a run is.
    """
    placed = [r for r in run.readings if r.sensor.quantity.tells_place]
    if not placed:
        moving = [r for r in run.readings if r.sensor.quantity.tells_speed]
        reach = max((float(np.max(np.abs(_si(r)))) for r in moving), default=1.0) or 1.0
        first = float(_si(moving[0])[0]) if moving else 0.0
        return 0.0, first, reach, _REACH * reach
    reading = placed[0]
    x, t = _si(reading), run.time_s[reading.rows]
    count = min(_FIRST, len(x))
    slope, at = np.polyfit(t[:count] - run.time_s[0], x[:count], 1) if count > 1 else (0.0, x[0])
    reach = float(np.ptp(x)) or 1.0
    if reading.sensor.zero is None:
        reach += abs(float(at))  # the axis' own zero may be anywhere
    speeds = np.abs(np.diff(x[::count]) / np.diff(t[::count])) if len(x) > count else np.ones(1)
    return float(at), float(slope), reach, _REACH * (float(speeds.max()) + abs(float(slope)))


def _si(reading: Reading) -> Floats:
    """Values of a reading in SI, as its sensor's stated scale and sign have them."""
    sensor = reading.sensor
    values: Floats = reading.values * sensor.factor / ((sensor.scale or 1.0) * (sensor.sign or 1))
    return values


def _scales(model: Model) -> Iterator[Parameter]:
    """Free scales of sensors, from where a straight line through measured and simulated is."""
    free = {r.sensor.name for _, r in model.readings if r.sensor.scale is None}
    predicted = model({}) if free else []
    for name in sorted(free):
        slopes = [
            slope_of(reading.values, own)
            for (_, reading), own in zip(model.readings, predicted, strict=True)
            if reading.sensor.name == name
        ]
        at = next((s for s in slopes if math.isfinite(s) and s), 1.0)
        low, high = sorted((at / _SCALE_REACH, at * _SCALE_REACH))
        yield Parameter(SCALE.format(name), "1", low, high, (at,), difference=DIFFERENCE)


def slope_of(measured: Floats, simulated: Floats) -> float:
    """The slope of measured against simulated values; NaN where those do not change."""
    apart = simulated - simulated.mean()
    power = float(apart @ apart)
    return float(apart @ (measured - measured.mean())) / power if power > 0 else math.nan


def fitted_base(model: Model, data: Sequence[Series], parameters: Sequence[Parameter]) -> BaseFit:
    """The free numbers fitted without effects; an axis' to the beginning of the runs first."""
    if not parameters:
        return BaseFit(())
    found = tuple(parameters)
    started = BaseFit(found).settings
    residuals = Residuals(model, data, scaled_at=started)
    for share in _SHARES if model.rig.kind == AXIS else _SHARES[-1:]:
        masks = [_beginning(series, share) for series in data]
        own = residuals.subset(np.concatenate(masks)) if share < 1 else residuals
        found = _fit(own, found)
    return BaseFit(found)


def _beginning(series: Series, share: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    assert series.time_s is not None, "a reading has times"
    begin, end = float(series.time_s[0]), float(series.time_s[-1])
    mask: np.ndarray[tuple[int], np.dtype[np.bool_]] = series.time_s <= begin + share * (
        end - begin
    )
    return mask


def _fit(residuals: Residuals, parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    low, high = np.array([p.low for p in parameters]), np.array([p.high for p in parameters])
    span = high - low

    def at(scaled: Floats) -> Floats:
        return residuals.at(_settings(parameters, (low + scaled * span).tolist()))

    first = np.clip((np.array([p.starts[0] for p in parameters]) - low) / span, 1e-3, 1 - 1e-3)
    result = least_squares(
        at, first, bounds=(0, 1), diff_step=DIFFERENCE, x_scale="jac", max_nfev=_MOST_CALLS
    )
    better = result.x if result.cost <= 0.5 * float(np.sum(at(first) ** 2)) else first
    values = (low + better * span).tolist()
    return tuple(replace(p, starts=(v,)) for p, v in zip(parameters, values, strict=True))


def _settings(parameters: Sequence[Parameter], values: Sequence[float]) -> Settings:
    return {BASE: {p.name: v for p, v in zip(parameters, values, strict=True)}}
