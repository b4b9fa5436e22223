"""Free numbers of a model - its own, starts of runs, scales of sensors - and their first fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.engine.assumed import FEWEST, INTERIOR
from mopro.engine.candidate import Candidate, Parameter
from mopro.engine.fits import NO_LIMIT, Fit, growing_fit, least_squares_fit
from mopro.engine.residuals import Residuals, examine, least_noise
from mopro.engine.series import Series, Settings
from mopro.formula.evaluate import Floats
from mopro.stated.data import Reading, Run
from mopro.stated.model import AXIS, KINEMATIC, THERMAL
from mopro.stated.simulation import BASE, SCALE, START, Model

# Steps of finite differences, as shares of the ranges. Fifty swings magnify a change.
DIFFERENCE = 1e-6
# Samples that the first position and speed are taken from, and multiples of what the data show
# within which a start is looked for.
_FIRST = 9
_REACH = 3.0
# Standard deviations about its first reading within which a node begins: of ten million starts two
# begin elsewhere, so that no end of the range decides.
_BEGINS_WITHIN = 6.0
# Standard deviation of where a line through one reading and one twice as late leads back to, of
# readings with a deviation of 1.
_LED_BACK = math.sqrt(5.0)
# Reach (K) of the start of a node where the zero of its sensor is unknown: more than
# thermometers are off by. Halved, one that is off by 6 K is not reached; doubled, one by 20 K is.
_REACH_C = 10.0
# Standard deviation of normal values whose absolute values have the median 1.
_DEVIATION_OF_MEDIAN = 1.4826
# Points of other starts, of which so many are fitted. Of 24 servos that clip, with numbers off by
# up to a factor of 7, one start misses the minimum of 2, and the best of 8 points fitted of none.
_POINTS, _REFITTED, _ROOT_STEPS = 8, 1, 30
# A free scale is looked for within this factor of where it starts.
_SCALE_REACH = 10.0


@dataclass(frozen=True)
class BaseFit:
    """Free numbers with the values that fit best without effects, as starts of a diagnosis."""

    parameters: tuple[Parameter, ...]

    @property
    def settings(self) -> Settings:
        return {BASE: {p.name: p.starts[0] for p in self.parameters}} if self.parameters else {}

    @property
    def notes(self) -> list[str]:
        """A line for each number that an end of its range stops, but for a 0 that it begins at."""
        return [
            f"{p.name} fits best at the end of its range, {p.starts[0]:.4g} {p.unit}, before "
            "effects are looked for: another law, a wider range or another start may fit better"
            for p in self.parameters
            if _is_stopped(p)
        ]


def _is_stopped(p: Parameter) -> bool:
    at = p.starts[0]
    return any(end and abs(p.scaled(at) - p.scaled(end)) < INTERIOR for end in (p.low, p.high))


def base_of(model: Model) -> list[Parameter]:
    """The free numbers of the model, from where the file or the data have them."""
    numbers = [
        Parameter(n.name, n.unit, n.low, n.high, (n.value,), difference=DIFFERENCE)
        for n in model.machine.numbers.values()
        if n.free
    ]
    starts = [p for run in model.experiment.trials for p in _starts(model, run)]
    return [*numbers, *starts, *_scales(model)]


def _starts(model: Model, run: Run) -> Iterator[Parameter]:
    """Free starts of the states of a run."""
    free = [state for state, at in run.start.items() if at is None]
    if model.machine.kind == KINEMATIC or not free:
        return
    if model.machine.kind == THERMAL:
        for state in free:
            yield _start(run, state, "C", *_first_temperature(run, state))
    if model.machine.kind == AXIS:
        x, v, reach_x, reach_v = _first_motion(run)
        machine = model.machine
        unit = {"x": machine.unit, "v": f"{machine.unit}/s"}
        for state, at, reach in (("x", x, reach_x), ("v", v, reach_v)):
            if state in free:
                yield _start(run, state, unit[state], at / machine.factor, reach / machine.factor)


def _start(run: Run, state: str, unit: str, at: float, reach: float) -> Parameter:
    name = START.format(run.name, state)
    own = at - reach, at + reach, (at,)
    return Parameter(name, unit, *own, difference=DIFFERENCE, run=run.name)


def _first_temperature(run: Run, node: str) -> tuple[float, float]:
    """The first temperature (C) of a node by its sensor, and how far from there (K) it may be."""
    reading = next((r for r in run.readings if node in r.sensor.reads.formula.names), None)
    reading = reading or run.readings[0]
    if reading.sensor.zero is None:
        return reading.first, _REACH_C
    # The stated noise may be too small.
    sigma = max(reading.sensor.noise_rms or 0.0, _noise_among_neighbours(run, reading))
    reach = _BEGINS_WITHIN * sigma * (_LED_BACK if reading.first_is_wild else 1.0)
    return reading.first, min(reach, _REACH_C)


def _noise_among_neighbours(run: Run, reading: Reading) -> float:
    """Standard deviation of what readings differ by from the line through those beside them.

    That of a step of the readings at the least. By the median, as a few may be wild, and what
    heats or cools a node bends its course in few places.
    """
    values, t = reading.values, run.time_s[reading.rows]
    least = least_noise(values, None)
    if len(values) < FEWEST:
        return least
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    apart = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    scaled = apart / np.sqrt(1 + share**2 + (1 - share) ** 2)
    return max(least, float(np.median(np.abs(scaled))) * _DEVIATION_OF_MEDIAN)


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
    speeds = np.abs(np.diff(x[::count]) / np.diff(t[::count])) if len(x) > count else np.ones(1)
    # Between readings that are equal it moves as well.
    fastest = max(float(speeds.max()) + abs(float(slope)), reach / float(t[-1] - t[0]))
    if reading.sensor.zero is None:
        reach += abs(float(at))  # the axis' own zero may be anywhere
    return float(at), float(slope), reach, _REACH * fastest


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


def fitted_base(
    model: Model, data: Sequence[Series], parameters: Sequence[Parameter], *, once: bool = False
) -> BaseFit:
    """The free numbers fitted without effects; an axis' to the beginning of the runs first.

    `once`: from one start, which may end in a worse minimum.
    """
    if not parameters:
        return BaseFit(())
    start = BaseFit(tuple(parameters)).settings
    residuals = Residuals(model, data, scaled_at=start)
    base = (Candidate(BASE, tuple(parameters)),)
    fit = _fitted(model, residuals, base, start)
    if not once and examine(residuals, fit.residual, len(fit.order)).significant:
        others = _elsewhere(model, residuals, fit.settings[BASE], parameters)
        fit = min([fit, *(_fitted(model, residuals, base, s) for s in others)], key=lambda f: f.rss)
    values = fit.settings[BASE]
    return BaseFit(tuple(replace(p, starts=(values[p.name],)) for p in parameters))


def _fitted(model: Model, residuals: Residuals, base: Sequence[Candidate], start: Settings) -> Fit:
    if model.runs_on:
        return growing_fit(residuals, (), start, NO_LIMIT, base)
    return least_squares_fit(residuals, (), [start], base=base)


def _elsewhere(
    model: Model, residuals: Residuals, found: Mapping[str, float], parameters: Sequence[Parameter]
) -> list[Settings]:
    """Other starts of the model's own numbers: of points spread over their ranges the lowest.

    What is left without effects may be that of another minimum of the law. The points are those
    of an additive recurrence, along the logarithm of a range that has no 0 in it.
    """
    own = [p for p in parameters if p.name in model.machine.numbers]
    starts: list[Settings] = [
        {BASE: {**found, **{p.name: _along(p, s) for p, s in zip(own, shares, strict=True)}}}
        for shares in _spread(len(own))
    ]
    return sorted(starts, key=lambda s: float(np.sum(residuals.at(s) ** 2)))[:_REFITTED]


def _along(p: Parameter, share: float) -> float:
    """The value at a share of the range."""
    return p.low * (p.high / p.low) ** share if p.low > 0 else p.low + share * (p.high - p.low)


def _spread(dimensions: int) -> Floats:
    """Points in the unit cube (points x dimensions): multiples of powers of a root, modulo 1.

    The root x of x^(d + 1) = x + 1 spreads them evenly in d dimensions (Roberts 2018).
    """
    root = 2.0
    for _ in range(_ROOT_STEPS):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    shares: Floats = (0.5 + np.arange(1, _POINTS + 1)[:, None] * steps) % 1
    return shares if dimensions else shares[:0]
