"""Machines of which only the kind is stated: their numbers are free, about what the data show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from mopro.errors import Diagnostic, ModelError
from mopro.formula.evaluate import Floats
from mopro.formula.written import Written
from mopro.source import Source, Span
from mopro.stated.data import Reading, Run, StatedExperiment
from mopro.stated.file import read_stated
from mopro.stated.model import AMBIENT, AXIS, THERMAL, StatedMachine
from mopro.stated.rough import Sampled, axis_lines, thermal_lines, unit_of_speed


def skeleton(kind: str, sensors: Sequence[str]) -> StatedMachine:
    """A machine of a kind before its data are read; `sensors` are those of temperatures."""
    laws = {name: Written.of("0") for name in sensors} if kind == THERMAL else {}
    return StatedMachine(kind, kind, "", {}, laws, (), {}, Source(kind, ""), kind_only=True)


def completed(experiment: StatedExperiment) -> StatedExperiment:
    """The experiment with a machine whose numbers are free, if only its kind was stated.

    Raises ModelError where the experiment has no input that could drive it.
    """
    machine = experiment.machine
    if not machine.kind_only:
        return experiment
    body = {AXIS: _axis, THERMAL: _thermal}[machine.kind]
    text = (
        "\n".join([f'kind = "{machine.kind}"', f'name = "{machine.name}"', *body(experiment)])
        + "\n"
    )
    made = read_stated(Source(machine.name, text)).beside(machine.effects)
    return replace(experiment, machine=replace(made, unit=made.unit or machine.unit))


def _missing(experiment: StatedExperiment, what: str, line: str) -> ModelError:
    message = f'machine = "{experiment.machine.kind}" needs {what}'
    hint = f"add, with the name of your column: {line}"
    finding = Diagnostic("no-numbers", message, Span(1, 1, 1), hint=hint)
    return ModelError(experiment.source, [finding])


def _axis(experiment: StatedExperiment) -> Iterator[str]:
    unit = _unit_of(experiment)
    units = experiment.units
    if not units:
        line = '[inputs] force = { column = "force_N" } (or torque, current, voltage, duty)'
        raise _missing(experiment, "an input that drives the axis", line)
    run, reading = _first(experiment, lambda r: r.sensor.quantity.tells_place)
    of_place = reading is not None
    if reading is None:
        run, reading = _first(experiment, lambda r: r.sensor.quantity.tells_speed)
    assert reading is not None, "there is a sensor of a place or of a speed"
    yield f'unit = "{unit}"'
    yield from axis_lines(unit, units, _sampled(run, reading, _si(reading)), of_place)


def _unit_of(experiment: StatedExperiment) -> str:
    """The unit of the axis: that of its place, else of its speed times a second."""
    readings = [r for run in experiment.trials for r in run.readings]
    if any(r.sensor.quantity.tells_place for r in readings):
        return experiment.machine.unit
    speeds = [r.sensor.unit for r in readings if r.sensor.quantity.tells_speed]
    if not speeds:
        line = '[[sensor]] quantity = "position" (or angle, or speed)'
        raise _missing(experiment, "a sensor of its place or its speed", line)
    return unit_of_speed(speeds[0])


def _thermal(experiment: StatedExperiment) -> Iterator[str]:
    units = {name: unit for name, unit in experiment.units.items() if name != AMBIENT}
    nodes = experiment.machine.nodes
    if not nodes:
        line = '[[sensor]] quantity = "temperature"'
        raise _missing(experiment, "a sensor of a temperature", line)
    if not units:
        line = '[inputs] power = { column = "power_W", unit = "W" } (or duty)'
        raise _missing(experiment, "an input that heats it", line)
    yield from thermal_lines(nodes, units, {node: _of_node(experiment, node) for node in nodes})


def _of_node(experiment: StatedExperiment, node: str) -> Sampled:
    run, reading = _first(experiment, lambda r: node in r.sensor.reads.formula.names)
    reading = reading or run.readings[0]
    sampled = _sampled(run, reading, reading.values)
    return replace(sampled, first=reading.first)


def _sampled(run: Run, reading: Reading, values: Floats) -> Sampled:
    inputs = {name: own[reading.rows] for name, own in run.inputs.items()}
    return Sampled(run.time_s[reading.rows], values, inputs, run.held)


def _first(
    experiment: StatedExperiment, wanted: Callable[[Reading], bool]
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
