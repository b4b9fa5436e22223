"""Machines of which only the kind is stated: their numbers are free, about what the data show.

First values come from a straight regression on the data, integrated in time, so that noise is
not magnified; ranges reach a factor of _REACH to either side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.errors import Diagnostic, ModelError
from mopro.formula import dimension_of_unit, factor_of, product
from mopro.formula.evaluate import Floats
from mopro.formula.written import Written
from mopro.rig.data import Reading, RigExperiment, Run
from mopro.rig.file import read_rig
from mopro.rig.model import AMBIENT, AXIS, THERMAL, Rig
from mopro.source import Source, Span

_REACH = 30.0
# A spring is a part of the model where it leaves less than this share of a regression's squares.
_SPRUNG = 0.2
# Windows in a run at the least. Halved, a regression may follow a single bend; doubled, slow
# motions drown in the noise.
_WINDOWS = 8
# Time constants in a run where the regression gives no loss.
_SLOWEST = 3.0
_NEWTON, _NEWTON_METRE, _METRE, _RAD, _WATT = map(dimension_of_unit, ("N", "N m", "m", "rad", "W"))


def skeleton(kind: str, sensors: Sequence[str]) -> Rig:
    """A machine of a kind before its data are read; `sensors` are those of temperatures."""
    laws = {name: Written.of("0") for name in sensors} if kind == THERMAL else {}
    return Rig(kind, kind, "", {}, laws, (), {}, Source(kind, ""), bare=True)


def completed(experiment: RigExperiment) -> RigExperiment:
    """The experiment with a machine whose numbers are free, if only its kind was stated.

    Raises ModelError where the experiment has no input that could drive it.
    """
    rig = experiment.machine
    if not rig.bare:
        return experiment
    body = {AXIS: _axis, THERMAL: _thermal}[rig.kind]
    text = "\n".join([f'kind = "{rig.kind}"', f'name = "{rig.name}"', *body(experiment)]) + "\n"
    made = read_rig(Source(rig.name, text)).beside(rig.effects)
    return replace(experiment, machine=replace(made, unit=made.unit or rig.unit))


def _missing(experiment: RigExperiment, what: str, line: str) -> ModelError:
    message = f'machine = "{experiment.machine.kind}" needs {what}'
    hint = f"add, with the name of your column: {line}"
    finding = Diagnostic("no-numbers", message, Span(1, 1, 1), hint=hint)
    return ModelError(experiment.source, [finding])


def _free(name: str, value: float, unit: str, signed: bool = False, low: float = 0.0) -> str:
    high = _REACH * abs(value)
    ends = f"[{-high if signed else low * abs(value):.4g}, {high:.4g}]"
    return f'{name} = {{ value = {value:.4g}, unit = "{unit}", free = true, range = {ends} }}'


# -- axis --------------------------------------------------------------------------------


def _axis(experiment: RigExperiment) -> Iterator[str]:
    unit = _unit_of(experiment)
    units = experiment.units
    if not units:
        line = '[inputs] force = { column = "force_N" } (or torque, current, voltage, duty)'
        raise _missing(experiment, "an input that drives the axis", line)
    names = list(units)
    sizes = _of_axis(experiment, names)
    yield f'unit = "{unit}"'
    if pushed := _inertia_of(unit, units):
        yield from _of_pushes(names, sizes, *pushed)
        return
    terms = [f"gain_{name} * {name}" for name in names] + ["-damping * v"]
    yield f'acceleration = "{_sum([*terms, *(["-w2 * x"] if sizes.stiffness else [])])}"'
    yield "[base]"
    for name, gain in zip(names, sizes.gains, strict=True):
        stated = product(f"{unit}/s2", f"1/{units[name]}" if units[name] != "1" else "1")
        yield _free(f"gain_{name}", gain / factor_of(stated), stated, signed=True)
    yield _free("damping", sizes.damping, "1/s")
    if sizes.stiffness:
        yield _free("w2", sizes.stiffness, "1/s2")


def _of_pushes(names: Sequence[str], sizes: _Sizes, inertia: str, turns: bool) -> Iterator[str]:
    """The law and the numbers of an axis under forces, or torques if it `turns`."""
    mass = 1 / max(float(np.mean(np.abs(sizes.gains))), 1e-12)
    terms = [*names, "-viscous * v", *(["-spring * x"] if sizes.stiffness else [])]
    yield f'acceleration = "({_sum(terms)}) / {inertia}"'
    yield "[base]"
    yield _free(inertia, mass, "kg m2" if turns else "kg", low=1 / _REACH)
    yield _free("viscous", sizes.damping * mass, "N m s/rad" if turns else "N s/m")
    if sizes.stiffness:
        yield _free("spring", sizes.stiffness * mass, "N m/rad" if turns else "N/m")


def _sum(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def _unit_of(experiment: RigExperiment) -> str:
    """The unit of the axis: that of its place, else of its speed times a second."""
    rig = experiment.machine
    readings = [r for run in experiment.trials for r in run.readings]
    if any(r.sensor.quantity.tells_place for r in readings):
        return rig.unit
    speeds = [r.sensor.unit for r in readings if r.sensor.quantity.tells_speed]
    if not speeds:
        line = '[[sensor]] quantity = "position" (or angle, or speed)'
        raise _missing(experiment, "a sensor of its place or its speed", line)
    return "rad" if dimension_of_unit(product(speeds[0], "s")) == _RAD else "m"


def _inertia_of(unit: str, units: Mapping[str, str]) -> tuple[str, bool] | None:
    """The inertia's name, and whether it turns, if all inputs are forces or torques; else None."""
    dimensions = {dimension_of_unit(own) for own in units.values()}
    if dimension_of_unit(unit) == _METRE and dimensions == {_NEWTON}:
        return "mass", False
    turns = dimension_of_unit(unit) == _RAD and dimensions == {_NEWTON_METRE}
    return ("inertia", True) if turns else None


@dataclass(frozen=True)
class _Sizes:
    """Rough sizes (SI): accelerations for one unit of each input, damping and stiffness, over m.

    The stiffness is 0 unless the data ask for one.
    """

    gains: Sequence[float]
    damping: float
    stiffness: float


def _of_axis(experiment: RigExperiment, names: Sequence[str]) -> _Sizes:
    """Sizes by regression on the first run with a sensor of the place, else of a speed.

    x = x0 + w t + sum of gain * input integrated twice - damping * integral of x - stiffness *
    x integrated twice + half the steady acceleration * t²; of a speed, the same integrated once
    less. Both sides are differenced over windows of several lengths, twice for a place, which
    removes x0 and w: an integral over the whole run would add up what is not linear. The window
    with the smallest share of squares left is taken.
    """
    run, reading = _first(experiment, lambda r: r.sensor.quantity.tells_place)
    times = 2
    if reading is None:
        run, reading = _first(experiment, lambda r: r.sensor.quantity.tells_speed)
        times = 1
    assert reading is not None, "there is a sensor of a place or of a speed"
    time_s = run.time_s[reading.rows] - run.time_s[reading.rows[0]]
    measured = _si(reading)
    pushed = [_integral(run.inputs[n][reading.rows], time_s, n in run.held) for n in names]
    pushed = [_integral(p, time_s) for p in pushed] if times == 2 else pushed
    once = _integral(measured - measured[0], time_s)
    steady = time_s**times
    columns = [*pushed, -once, steady, -_integral(once, time_s)]
    plain, sprung = (np.inf, [0.0] * len(columns)), (np.inf, [0.0] * len(columns))
    for window in _windows(len(time_s)):
        own, *others = (_differences(c, time_s, window, times) for c in (measured, *columns))
        plain = min(plain, _regressed(own, others[:-1]))
        sprung = min(sprung, _regressed(own, others))
    has_spring = sprung[0] < _SPRUNG * plain[0] and sprung[1][-1] > 0
    found = (sprung if has_spring else plain)[1]
    gains = [
        gain or (float(np.std(measured)) / (float(np.std(column)) or 1.0)) or 1.0
        for gain, column in zip(found, pushed, strict=False)
    ]
    damping = max(found[len(names)], _SLOWEST / max(float(time_s[-1]), 1e-9))
    return _Sizes(gains, damping, sprung[1][-1] if has_spring else 0.0)


def _windows(count: int) -> Iterator[int]:
    """Lengths of windows (samples): 1, and each power of 2 with `_WINDOWS` of them in `count`."""
    window = 1
    while window == 1 or window * _WINDOWS <= count:
        yield window
        window *= 2


def _differences(values: Floats, time_s: Floats, window: int, times: int) -> Floats:
    """Differences over `window` samples, or, if `times` is 2, those of the slopes over them."""
    apart: Floats = values[window:] - values[:-window]
    if times == 1:
        return apart
    slope: Floats = apart / (time_s[window:] - time_s[:-window])
    return slope[window:] - slope[:-window]


def _regressed(measured: Floats, columns: Sequence[Floats]) -> tuple[float, list[float]]:
    """The share of the squares that is left, and the factor of each column."""
    basis = np.stack(columns, axis=1)
    sizes = np.linalg.norm(basis, axis=0)
    sizes[sizes == 0] = 1.0
    found = np.linalg.lstsq(basis / sizes, measured, rcond=1e-9)[0] / sizes
    left = float(np.sum((measured - basis @ found) ** 2))
    return left / (float(measured @ measured) or 1.0), found.tolist()


def _integral(values: Floats, time_s: Floats, held: bool = False) -> Floats:
    """Integral from the first time on, of straight lines between values, or of steps if `held`."""
    means = values[:-1] if held else (values[1:] + values[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(np.diff(time_s) * means)])


def _first(
    experiment: RigExperiment, wanted: Callable[[Reading], bool]
) -> tuple[Run, Reading | None]:
    """The first run with a reading that is wanted, and that reading."""
    for run in experiment.trials:
        for reading in run.readings:
            if wanted(reading):
                return run, reading
    return experiment.trials[0], None


def _si(reading: Reading) -> Floats:
    sensor = reading.sensor
    values: Floats = reading.values * sensor.factor / ((sensor.scale or 1.0) * (sensor.sign or 1))
    return values


# -- thermal -----------------------------------------------------------------------------


def _thermal(experiment: RigExperiment) -> Iterator[str]:
    units = {name: unit for name, unit in experiment.units.items() if name != AMBIENT}
    if not experiment.machine.nodes:
        line = '[[sensor]] quantity = "temperature"'
        raise _missing(experiment, "a sensor of a temperature", line)
    if not units:
        line = '[inputs] power = { column = "power_W", unit = "W" } (or duty)'
        raise _missing(experiment, "an input that heats it", line)
    driven = _driven(experiment.machine.nodes, list(units))
    powered = {dimension_of_unit(unit) for unit in units.values()} == {_WATT}
    gains, loss = _of_nodes(experiment, driven)
    yield "[nodes]"
    for node in experiment.machine.nodes:
        own = [n if powered else f"a_{n} * {n}" for n in driven.get(node, ())]
        heated = " + ".join(own) + " - " if own else "-"
        yield f'{node} = "{heated}{"loss" if powered else "U"} * (T - ambient)"'
    yield "[base]"
    if powered:
        capacity = 1 / float(np.mean(list(gains.values())))
        yield _free("capacity", capacity, "J/K", low=1 / _REACH)
        yield _free("loss", loss * capacity, "W/K")
        return
    for name, unit in units.items():
        stated = product("K/s", f"1/{unit}") if unit not in ("1", "%") else "K/s"
        scale = factor_of(stated) if unit not in ("1", "%") else 1.0
        yield _free(f"a_{name}", gains[name] / scale, stated)
    yield _free("U", loss, "1/s")


def _driven(nodes: Sequence[str], inputs: Sequence[str]) -> dict[str, list[str]]:
    """Inputs of each node: the node that bears the input's number, else the first one."""
    driven: dict[str, list[str]] = {}
    for name in inputs:
        digits = [c for c in name if c.isdigit()][:1]
        same = [node for node in nodes if digits and digits[0] in node]
        driven.setdefault((same or list(nodes))[0], []).append(name)
    return driven


def _of_nodes(
    experiment: RigExperiment, driven: Mapping[str, Sequence[str]]
) -> tuple[dict[str, float], float]:
    """Rates (K/s in SI) for one unit of each input, and the rate of loss (1/s), roughly.

    T = T0 + sum of gain * integral of input - loss * integral of T - T0.
    """
    gains: dict[str, float] = {}
    losses = []
    for node, names in driven.items():
        run, reading = _first(experiment, lambda r, n=node: n in r.sensor.reads.formula.names)  # type: ignore[misc]
        reading = reading or run.readings[0]
        time_s = run.time_s[reading.rows] - run.time_s[reading.rows[0]]
        risen = reading.values - reading.first
        pushed = [_integral(run.inputs[n][reading.rows], time_s) for n in names]
        *found, loss = _regressed(risen, [*pushed, -_integral(risen, time_s)])[1]
        slowest = _SLOWEST / max(float(time_s[-1]), 1e-9)
        losses.append(loss if loss > slowest / _REACH else slowest)
        for name, gain, column in zip(names, found, pushed, strict=True):
            rough = float(np.ptp(risen)) / (float(np.ptp(column)) or 1.0)
            gains[name] = gain if gain > 0 else rough or 1.0
    return gains, float(np.mean(losses))
