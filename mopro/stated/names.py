"""Names that the formulas of a machine may use in an experiment, with their dimensions."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

import numpy as np

from mopro.errors import Diagnostic, ModelError
from mopro.formula import Dimension, Formula, dimension_of_unit, parse, product
from mopro.formula.dimension import NUMBER
from mopro.formula.shapes import TIME
from mopro.formula.written import COMMAND, MEASUREMENT, WrittenEffect
from mopro.instruments.quantity import AXIS_UNITS
from mopro.source import Span
from mopro.stated.data import Sensor, StatedExperiment
from mopro.stated.file import EFFORT, catalogue, unlisted_terms
from mopro.stated.model import (
    AMBIENT,
    AXIS,
    IN_EQUATIONS,
    INPUT,
    KINEMATIC,
    POWER,
    PYTHON,
    THERMAL,
    StatedMachine,
)
from mopro.stated.of_sensors import crosstalk_of, plays_of

Dimensions = dict[str, Dimension | None]
_KELVIN = dimension_of_unit("K")
# An angle (rad) that is a whole turn but for a step.
_TURN = 0.95 * 2 * math.pi


_NAME = re.compile(r"[A-Za-z_]\w*")


def divided(one: Dimension, other: Dimension) -> Dimension:
    return tuple(a - b for a, b in zip(one, other, strict=True))


def inertia_of(machine: StatedMachine) -> str | None:
    """The number that is the axis' mass or inertia; None if it has none."""
    return next((name for name in ("mass", "inertia") if name in machine.numbers), None)


def capacity_of(machine: StatedMachine) -> str | None:
    """The number that is the nodes' heat capacity; None if it has none."""
    return "capacity" if "capacity" in machine.numbers else None


def axis_dimension(experiment: StatedExperiment) -> Dimension:
    return dimension_of_unit(experiment.machine.unit or "1")


def names_of(experiment: StatedExperiment) -> Dimensions:
    """The names of time, inputs, numbers and states."""
    machine = experiment.machine
    known: Dimensions = {"t": TIME}
    known |= {name: dimension_of_unit(unit) for name, unit in experiment.units.items()}
    known |= {name: dimension_of_unit(number.unit) for name, number in machine.numbers.items()}
    if machine.kind == THERMAL:
        known |= dict.fromkeys(machine.nodes, _KELVIN)
    elif machine.kind != PYTHON:
        x = axis_dimension(experiment)
        known |= {"x": x, "v": divided(x, TIME), "a": divided(divided(x, TIME), TIME)}
    return known


def in_a_node(experiment: StatedExperiment) -> Dimensions:
    """Names that the formulas of a node have beside the others."""
    units = list(experiment.units.values())
    foreign = dimension_of_unit(units[0]) if units else NUMBER
    return {
        "T": _KELVIN, "ambient": _KELVIN, "exchange": _KELVIN, "in_first": NUMBER,
        "foreign": foreign,
    }  # fmt: skip


def force_dimension(experiment: StatedExperiment) -> Dimension:
    """That of an axis' force: of an acceleration where it has no mass or inertia."""
    machine = experiment.machine
    inertia = inertia_of(machine)
    own = dimension_of_unit(machine.numbers[inertia].unit) if inertia else NUMBER
    x = divided(divided(axis_dimension(experiment), TIME), TIME)
    return tuple(a + b for a, b in zip(own, x, strict=True))


def power_dimension(experiment: StatedExperiment) -> Dimension:
    """That of a node's power: of a rate where it has no capacity."""
    capacity = capacity_of(experiment.machine)
    own = dimension_of_unit(experiment.machine.numbers[capacity].unit) if capacity else NUMBER
    return tuple(a + b for a, b in zip(own, divided(_KELVIN, TIME), strict=True))


def effects_of(experiment: StatedExperiment) -> tuple[WrittenEffect, ...]:
    """The effects of the machine's file, and those of the catalogue whose names there are.

    A user's effect takes the place of a listed one of its name, and of one with the same formula:
    under two names one effect would be ambiguous.
    """
    machine, listed = experiment.machine, listed_of(experiment)
    own = {effect.name for effect in machine.effects} | machine.numbers.keys()
    if _only_speeds(experiment):
        listed = tuple(e for e in listed if e.enters != MEASUREMENT)
    same = {_in_essence(effect) for effect in machine.effects}
    usable = [
        e for e in _usable(listed, experiment) if e.name not in own and _in_essence(e) not in same
    ]
    used, sensors = _used(experiment, [*machine.effects, *usable]), sensors_of(experiment)
    each = [*plays_of(experiment, sensors), *crosstalk_of(experiment, sensors, used)]
    each = [e for e in each if e.name not in own and _in_essence(e) not in same]
    return (*machine.effects, *usable, *each)


def _used(experiment: StatedExperiment, effects: Iterable[WrittenEffect]) -> frozenset[str]:
    """The names that formulas of the machine, its sensors and its effects use.

    A program may use any.
    """
    machine = experiment.machine
    if machine.kind == PYTHON:
        return frozenset(experiment.units)
    law = axis_law(experiment) if machine.kind == AXIS else None
    formulas = [law] if law is not None else []
    formulas += [own.formula for own in machine.laws.values()]
    formulas += [sensor.reads.formula for sensor in sensors_of(experiment)]
    named = [formula.names for formula in formulas]
    return frozenset({AMBIENT}).union(*named, *map(_needs, effects))


def _in_essence(effect: WrittenEffect) -> tuple[str, ...]:
    """Key of an effect under any names: its entry, and its formula with numbered parameters."""
    text, own = effect.term.formula.text, {p.name for p in effect.parameters}
    used = dict.fromkeys(name for name in _NAME.findall(text) if name in own)
    places = {name: f"${i}" for i, name in enumerate(used)}
    text = _NAME.sub(lambda m: places.get(m[0], m[0]), text)
    return effect.enters, effect.target, re.sub(r"\s", "", text)


def listed_of(experiment: StatedExperiment) -> tuple[WrittenEffect, ...]:
    """The effects of the catalogue for the machine's kind, those that these data lack included."""
    of = EFFORT if _effort(experiment) else ""
    return catalogue(experiment.machine.kind, tuple(sorted(units_of(experiment).items())), of)


def unlisted_of(experiment: StatedExperiment) -> tuple[WrittenEffect, ...]:
    """The free-form terms of the machine's kind whose names are in the experiment."""
    machine = experiment.machine
    terms = unlisted_terms(machine.kind, tuple(sorted(units_of(experiment).items())))
    alike = len(set(experiment.units.values())) == 1
    return tuple(e for e in _usable(terms, experiment) if alike or e.enters != INPUT)


def _usable(
    effects: Iterable[WrittenEffect], experiment: StatedExperiment
) -> Iterator[WrittenEffect]:
    """Those whose names are in the experiment, and which its inputs can show."""
    known = names_of(experiment).keys()
    fed_back = any(run.feedback for run in experiment.trials)
    for effect in effects:
        driven = effect.driven or effect.enters == INPUT
        if (
            _needs(effect) <= known | _local(experiment.machine, effect)
            and (experiment.units or not driven)
            and (not effect.rotary or _turns(experiment))
            and (not effect.angular or axis_dimension(experiment) == NUMBER)
            and _of_its_force(effect, experiment)
            and not (fed_back and _follows(effect))
        ):
            yield effect


def _of_its_force(effect: WrittenEffect, experiment: StatedExperiment) -> bool:
    """False for a force that names an input of another unit, such as N at the lever of a shaft."""
    pushes = experiment.machine.kind == AXIS and effect.enters in IN_EQUATIONS
    named = _needs(effect) & experiment.units.keys() if pushes else ()
    wanted = force_dimension(experiment) if named else None
    return all(dimension_of_unit(experiment.units[name]) == wanted for name in named)


def _only_speeds(experiment: StatedExperiment) -> bool:
    """True if a kinematic machine is read by its speed, which no listed error of a place is of."""
    sensors = sensors_of(experiment)
    kinematic = experiment.machine.kind == KINEMATIC
    return kinematic and bool(sensors) and sensors[0].quantity.tells_speed


def _turns(experiment: StatedExperiment) -> bool:
    """True if the axis is seen to make a whole turn."""
    return any(
        float(np.ptp(r.values)) * r.sensor.factor > _TURN
        for run in experiment.trials
        for r in run.readings
        if r.sensor.quantity.tells_place and r.sensor.dimension == NUMBER
    )


def _follows(effect: WrittenEffect) -> bool:
    """True if an effect is one of the command: what made the command hides what acts on it."""
    return effect.enters in (COMMAND, INPUT) or bool(effect.term.formula.names & {"x", "v", "a"})


def _needs(effect: WrittenEffect) -> frozenset[str]:
    return effect.term.formula.names - {p.name for p in effect.parameters}


def _local(machine: StatedMachine, effect: WrittenEffect) -> set[str]:
    if effect.enters == POWER:
        several = {"exchange", "in_first", "foreign"} if len(machine.nodes) > 1 else set()
        return {"T", "ambient", *several}
    return {MEASUREMENT: {"y"}, INPUT: {"u"}}.get(effect.enters, set())


def units_of(experiment: StatedExperiment) -> dict[str, str]:
    """The units that stand for `{x}` and the like in the catalogue."""
    machine, inputs = experiment.machine, experiment.units
    first = next(iter(inputs.values()), "1")
    units = {"load": inputs.get("load", "1"), "foreign": first, "u": first}
    if machine.kind == THERMAL:
        return {**units, "power": "W" if capacity_of(machine) else "K/s"}
    effort = _effort(experiment)
    if machine.kind == KINEMATIC and not effort:
        return {**units, "x": machine.unit or "1"}
    x = place_unit(experiment)
    if effort:
        return {**units, "x": x, "force": effort}
    force = {"mass": "N", "inertia": "N m"}.get(inertia_of(machine) or "", product(x, "1/s2"))
    return {**units, "x": x, "force": force}


def place_unit(experiment: StatedExperiment) -> str:
    """The SI unit of the axis' place."""
    own = axis_dimension(experiment)
    return next(unit for unit in AXIS_UNITS if dimension_of_unit(unit) == own)


def _effort(experiment: StatedExperiment) -> str:
    """SI unit of the effort that the first sensor of a kinematic machine reads; "" if of motion."""
    sensors = sensors_of(experiment)
    if experiment.machine.kind != KINEMATIC or not sensors or sensors[0].quantity.reads:
        return ""
    first = sensors[0]
    return next(u for u in first.quantity.units if dimension_of_unit(u) == first.dimension)


def check(experiment: StatedExperiment, effects: tuple[WrittenEffect, ...]) -> None:
    """ModelError for a law or an effect that uses an unknown name, or whose units do not match."""
    machine, known = experiment.machine, names_of(experiment)
    if machine.kind == KINEMATIC and machine.laws["position"].value is None:
        _check_command(experiment)
    for law in machine.laws.values():
        names = known | (in_a_node(experiment) if machine.kind == THERMAL else {})
        if machine.kind == KINEMATIC:
            # The law is what the place is worked out from.
            names = {name: own for name, own in known.items() if name not in ("x", "v", "a")}
        law.check(names, _law_dimension(experiment), "the law")
    for sensor in sensors_of(experiment):
        if machine.kind != PYTHON:
            _check_reads(sensor, known)
    for effect in effects:
        if machine.kind != PYTHON:
            _check_effect(effect, experiment, known)


def _check_command(experiment: StatedExperiment) -> None:
    """ModelError where there is no command to follow, or one of another quantity than the place."""
    command_unit, own = experiment.units.get("command"), experiment.machine.unit or "1"
    if command_unit is None:
        message = "a kinematic machine needs a command, the place that it is told"
        hint = 'add, with the name of your column: [inputs] command = { column = "target_mm" }'
    elif dimension_of_unit(command_unit) != axis_dimension(experiment):
        message = f"the command is in {command_unit}, and the place that is read in {own}"
        hint = 'state the formula of the place in a machine file: position = "ratio * command"'
    else:
        return
    raise ModelError(
        experiment.source, [Diagnostic("no-command", message, Span(1, 1, 1), hint=hint)]
    )


def _check_reads(sensor: Sensor, known: Dimensions) -> None:
    """ModelError where what a sensor reads is not there, or of another unit."""
    name = sensor.reads.formula.text
    if sensor.reads.value is None and sensor.value is not None:
        if name not in known:
            message = f"state what {sensor.name} reads: there is no {name}"
            hint = (
                'such as reads = "mass * a + viscous * v", of numbers in [base] of a machine file'
            )
            if known.get("x") == sensor.dimension:
                hint += ', or quantity = "position" of the axis'
            raise sensor.value.error(message, "missing-key", hint)
        if known[name] not in (None, sensor.dimension):
            message = f"{sensor.name} is in {sensor.unit}, which is no unit of the model's {name}"
            raise sensor.value.error(message, "wrong-unit")
    sensor.reads.check(known, sensor.dimension, f"sensor {sensor.name}")


def _check_effect(effect: WrittenEffect, experiment: StatedExperiment, known: Dimensions) -> None:
    own: Dimensions = {p.name: dimension_of_unit(p.unit) for p in effect.parameters}
    sensors = [s for s in sensors_of(experiment) if effect.target in ("", s.name)]
    wanted: Dimension | None = None
    match effect.enters:
        case "command":
            wanted = axis_dimension(experiment)
        case "force" | "friction":
            wanted = force_dimension(experiment)
        case "power":
            wanted, own = power_dimension(experiment), own | in_a_node(experiment)
        case "ambient":
            wanted = _KELVIN
        case "measurement":
            wanted = sensors[0].dimension if len({s.dimension for s in sensors}) == 1 else None
            own["y"] = wanted
        case "input":
            units = [u for n, u in experiment.units.items() if effect.target in ("", n)]
            wanted = dimension_of_unit(units[0]) if len(set(units)) == 1 else None
            own["u"] = wanted
    if effect.target and not sensors and effect.enters == MEASUREMENT and effect.value is not None:
        raise effect.value["enters"].error(f"there is no sensor {effect.target}", "unknown-name")
    effect.term.check(known | own, wanted, f"what enters as {effect.enters}")
    if effect.term.formula.of_signals and effect.enters in IN_EQUATIONS:
        assert effect.value is not None
        message = "lag, delayed, play and the like act on whole signals, not inside an equation"
        raise effect.value["formula"].error(message, "bad-formula")


def _law_dimension(experiment: StatedExperiment) -> Dimension | None:
    match experiment.machine.kind:
        case "kinematic":
            return axis_dimension(experiment)
        case "axis":
            return divided(divided(axis_dimension(experiment), TIME), TIME)
        case "thermal":
            return power_dimension(experiment)
    return None


def sensors_of(experiment: StatedExperiment) -> list[Sensor]:
    """The sensors that were read, each once."""
    found = [r.sensor for run in experiment.trials for r in run.readings]
    return list({sensor.name: sensor for sensor in found}.values())


def axis_law(experiment: StatedExperiment) -> Formula | None:
    """The force that the numbers of an axis and its inputs make; None where its file has a law."""
    machine, inputs = experiment.machine, experiment.units.keys()
    if "acceleration" in machine.laws:
        return None
    has = machine.numbers.keys()
    parts: list[str] = [name for name in ("force", "torque") if name in inputs]
    if "constant" in has and "current" in inputs:
        parts.append("constant * current")
    if {"constant", "resistance"} <= has and "voltage" in inputs:
        parts.append("constant * (voltage - constant * v) / resistance")
    if {"constant", "resistance", "supply"} <= has and "duty" in inputs:
        parts.append("constant * (supply * duty - constant * v) / resistance")
    parts += ["-viscous * v"] if "viscous" in has else []
    parts += ["-spring * x"] if "spring" in has else []
    parts += ["-gravity * sin(x)"] if "gravity" in has else []
    return parse(" + ".join(parts) or "0")
