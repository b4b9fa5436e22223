"""Texts of an imported experiment: machine.toml and experiment.toml, each decision a comment."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from scipy import signal as signals

from mopro.formula import dimension_of_unit, factor_of, inverse, product
from mopro.importing.imported_runs import file_of, rows_text
from mopro.importing.propose import Proposal
from mopro.importing.roles import Signal, decision_of
from mopro.logs import Decision, Rows
from mopro.stated.rough import Sampled, axis_lines, thermal_lines, unit_of_speed
from mopro.text import visible

_HEAD = (
    "# Written by `mopro import` from {source}.",
    "# A comment gives the reason of what follows; CHECK marks what the log does not settle.",
)
_FREE_NUMBERS = (
    "# the log does not state the numbers: they are free, about what a regression on it shows"
)
# A free ratio is looked for within this factor of what the log shows.
_RATIO_REACH = 10.0
# Names that the formulas of some kind of machine know already.
_RESERVED = frozenset(
    ["t", "x", "v", "a", "y", "u", "T", "pi", "ambient", "exchange", "foreign", "command"]
)


def experiment_text(
    source: str, proposal: Proposal, decisions: Sequence[Decision], rows: Rows, runs: int = 1
) -> str:
    """The text of experiment.toml, with the ledger of the log's rows and a section for each run."""
    machine = "chow1992" if proposal.kind == "sawyer" else "machine.toml"
    lines = [
        *(line.format(source=_quoted(source)) for line in _HEAD),
        *_comments(decisions),
        f"machine = {_quoted(machine)}",
        "",
        *rows_text(rows, decisions),
        *(_sawyer(proposal) if proposal.kind == "sawyer" else _foreign(proposal)),
        *(line for nth in range(runs) for line in _run(proposal, nth)),
        "",
        "# Columns that are in the data and not used:",
        *_comments([decision_of(s) for s in proposal.unused]),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _foreign(proposal: Proposal) -> Iterator[str]:
    if proposal.command is not None or proposal.inputs:
        yield "[inputs]"
    if proposal.command is not None:
        yield from _comments([decision_of(proposal.command)])
        yield _input("command", proposal.command)
    for name, one in named_inputs(proposal).items():
        yield from _comments([decision_of(one)])
        yield _input(name, one)
    for sensor in proposal.sensors:
        yield ""
        yield from _sensor(proposal, sensor)
        if proposal.kind == "kinematic" and proposal.command is None:
            yield '# drift = "free"     # CHECK: for a slow straight drift beside the command'


def _input(name: str, one: Signal) -> str:
    hold = ", hold = true" if one.held else ""
    unit = _quoted(one.unit_word)
    return f"{name} = {{ column = {_quoted(one.label)}, unit = {unit}{hold} }}"


def named_inputs(proposal: Proposal) -> dict[str, Signal]:
    """Inputs by the names that formulas use: the quantity where it is the only one of its kind."""
    quantities = [one.quantity for one in proposal.inputs]
    sensors = {sensor_name(sensor) for sensor in proposal.sensors}
    named = {}
    for one in proposal.inputs:
        name = str(one.quantity) if quantities.count(one.quantity) == 1 else sensor_name(one)
        named[f"{name}_input" if name in sensors else name] = one
    return named


def sensor_name(one: Signal) -> str:
    """The label without its unit, and never a name that formulas have for themselves."""
    name = one.label.removesuffix(f"_{one.unit}")
    return f"{name}_column" if name in _RESERVED else name


def _sensor(proposal: Proposal, sensor: Signal) -> Iterator[str]:
    yield "[[sensor]]"
    yield from _comments([decision_of(sensor)])
    yield f"name = {_quoted(sensor_name(sensor))}"
    yield f"quantity = {_quoted(sensor.quantity or '')}"
    yield f"column = {_quoted(sensor.label)}"
    yield f"unit = {_quoted(sensor.unit_word)}"
    if sensor.is_warmth:
        yield "# a temperature is absolute: no offset is fitted"
        yield "zero = 0"
    elif proposal.kind == "axis" and proposal.inputs and sensor.is_place:
        yield "# the place at the start is fitted: an offset beside it could not be told from it"
        yield "zero = 0"
    yield from _noise(proposal, sensor)
    yield from _relation(proposal, sensor)


def _noise(proposal: Proposal, sensor: Signal) -> Iterator[str]:
    noise = proposal.noises[sensor.label]
    if noise.found is None:
        yield from _comments([Decision("noise", "unknown", noise.reason, check=True)])
        if noise.between:
            yield f"# neighbours of a smooth motion leave {noise.between:.3g}: it is hardly more"
        yield 'noise_rms = "unknown"'
        if noise.step:
            yield f"adc_step = {noise.step:.6g}"
        return
    yield f"# noise at standstill: {noise.reason}"
    yield f"noise_rms = {noise.found.noise_rms:.4g}"
    if noise.found.adc_step:
        yield f"adc_step = {noise.found.adc_step:.6g}"


def _relation(proposal: Proposal, sensor: Signal) -> Iterator[str]:
    relation = proposal.relations.get(sensor.label)
    if relation is None or proposal.command is None:
        return
    if not relation.related:
        reason = f"correlation {relation.correlation:.2f}"
        yield from _comments(
            [Decision("this column", "does not follow the command", reason, check=True)]
        )
    alike = not scaled(proposal.command, sensor)
    for words in relation.words(alike):
        yield f"# CHECK: {words}"


def _comments(decisions: Iterable[Decision]) -> Iterator[str]:
    for decision in decisions:
        text = " ".join(visible(str(decision)).split())
        yield f"# {'CHECK: ' if decision.check else ''}{text}"


def _quoted(text: str) -> str:
    return json.dumps(visible(text).replace("\x7f", " "), ensure_ascii=False)


# -- the drive of 1992 ------------------------------------------------------------------


def sawyer_labels(proposal: Proposal) -> dict[str, str]:
    """Columns of the data under the names that a Sawyer machine's experiment has."""
    return {s.label: f"position_{n}_{s.unit}" for n, s in enumerate(proposal.sensors, start=1)}


def _sawyer(proposal: Proposal) -> Iterator[str]:
    labels = sawyer_labels(proposal)
    for axis, sensor in enumerate(proposal.sensors, start=1):
        times, _ = sensor.present
        rate_hz = 1 / float(np.median(np.diff(times)))
        yield "[[sensor]]"
        yield from _comments([decision_of(sensor)])
        yield f"name = {_quoted(sensor_name(sensor))}"
        yield 'quantity = "position"'
        yield f"axis = {axis}"
        yield f"column = {_quoted(labels[sensor.label])}"
        yield f"# the median interval of its times is {1 / rate_hz:.6g} s"
        yield f"rate_hz = {rate_hz:.6g}"
        yield from _noise(proposal, sensor)
        yield from _relation(proposal, sensor)


def _run(proposal: Proposal, nth: int) -> Iterator[str]:
    """A run with its files, from 0."""
    yield ""
    yield "[[run]]"
    if proposal.kind == "sawyer" and proposal.command is None:
        yield "# CHECK: the log has no command: name the program that ran"
        yield 'program = "PROGRAM.CMD"'
    elif proposal.kind == "sawyer" and proposal.command is not None:
        yield from _comments([decision_of(proposal.command)])
        yield f"command = {_quoted(file_of('command.csv', nth))}"
    yield f"data = {_quoted(file_of('data.csv', nth))}"


# -- machines ---------------------------------------------------------------------------


def machine_text(source: str, name: str, proposal: Proposal) -> str:
    """The text of machine.toml; a Sawyer machine is built in and has none."""
    body = {"kinematic": _kinematic, "axis": _axis, "thermal": _thermal}[proposal.kind]
    lines = [
        *(line.format(source=_quoted(source)) for line in _HEAD),
        f"kind = {_quoted(proposal.kind)}",
        f"name = {_quoted(name)}",
        *body(proposal),
    ]
    return "\n".join(lines) + "\n"


def _kinematic(proposal: Proposal) -> Iterator[str]:
    sensor, command = proposal.sensors[0], proposal.command
    own = place_word(sensor)
    yield f"unit = {_quoted(own)}"
    if command is None:
        yield "# CHECK: the log has no command: the axis should stand still"
        yield 'position = "0"'
        return
    if scaled(command, sensor):
        yield from _ratio(proposal, command, sensor, own)
        return
    yield "# the axis goes where it is told: x = command"
    for relation in list(proposal.relations.values())[:1]:
        if relation.related and relation.scaled:
            unit = product(own, inverse(command.unit_word))
            size = relation.scale / factor_of(unit)
            yield f"# CHECK: the readings are {relation.scale:.5g} times the command; to fit that:"
            yield '# position = "gain * command"'
            yield "# [base]"
            yield f'# gain = {{ value = {size:.5g}, unit = "{unit}", free = true }}'


def place_word(sensor: Signal) -> str:
    """The unit of the place that a sensor of a place or of a speed tells."""
    return sensor.unit_word if sensor.is_place else unit_of_speed(sensor.unit_word)


def scaled(command: Signal, sensor: Signal) -> bool:
    """True if no unit tells how far the sensor's axis goes for one unit of the command."""
    own = place_word(sensor)
    counted = "count" in (command.unit, own) and command.unit != own
    return counted or command.dimension != dimension_of_unit(own)


def _ratio(proposal: Proposal, command: Signal, sensor: Signal, own: str) -> Iterator[str]:
    """The law of an axis that is commanded in another kind of unit than it is read in."""
    size = _ratio_size(proposal, command, sensor, factor_of(own))
    unit = product(own, inverse(command.unit_word))
    units = f"the command is in {command.unit_word}, the readings in {sensor.unit_word}"
    yield f"# CHECK: {units}: the scale between them is fitted"
    if own == "count" and command.quantity == "angle":
        turn = factor_of("turn") / command.si
        yield f"# counts of a turn (cpr) = {turn:.6g} * ratio: state the ratio if you know them"
    yield 'position = "ratio * command"'
    yield "[base]"
    ends = sorted((size / _RATIO_REACH, size * _RATIO_REACH))
    yield (
        f'ratio = {{ value = {size:.6g}, unit = "{unit}", free = true, '
        f"range = [{ends[0]:.6g}, {ends[1]:.6g}] }}"
    )


def _ratio_size(proposal: Proposal, command: Signal, sensor: Signal, own: float) -> float:
    """Units of the axis for one of the command: the slope between them, or that of spans."""
    relation = proposal.relations.get(sensor.label)
    if sensor.is_place and relation is not None and relation.related:
        return relation.scale * command.si / own
    commanded, seen = command.present[1], sensor.present
    values = seen[1] * sensor.si
    if sensor.is_speed:
        values = np.cumsum(values * np.gradient(seen[0]))
    return float(np.ptp(values)) / own / (float(np.ptp(commanded)) or 1.0) or 1.0


def _axis(proposal: Proposal) -> Iterator[str]:
    sensor = proposal.sensors[0]
    unit = place_word(sensor)
    yield f"unit = {_quoted(unit)}"
    if not proposal.inputs:
        yield from _free_axis(sensor)
        return
    inputs = named_inputs(proposal)
    units = {name: one.unit_word for name, one in inputs.items()}
    yield _FREE_NUMBERS
    yield from axis_lines(unit, units, _sampled(sensor, inputs), sensor.is_place)


def _sampled(sensor: Signal, inputs: Mapping[str, Signal]) -> Sampled:
    times, values = sensor.present
    pushed = {name: one.at(times) * one.si for name, one in inputs.items()}
    held = frozenset(name for name, one in inputs.items() if one.held)
    return Sampled(times, values * sensor.si, pushed, held)


def _thermal(proposal: Proposal) -> Iterator[str]:
    inputs = named_inputs(proposal)
    units = {name: one.unit_word for name, one in inputs.items()}
    seen = {sensor_name(s): _sampled(s, inputs) for s in proposal.sensors}
    yield ""
    yield "# K/s of each node, or W with a capacity; `ambient` is its temperature at the start."
    yield _FREE_NUMBERS
    yield from thermal_lines(list(seen), units, seen)


def _free_axis(sensor: Signal) -> Iterator[str]:
    """A free axis swings: its frequency is that of the strongest line."""
    rate = _natural_rate_1_s2(sensor)
    place = "sin(x)" if sensor.quantity == "angle" else "x"
    yield "# nothing drives it: it swings freely"
    yield f'acceleration = "-w2 * {place} - b * v"'
    yield ""
    yield "[base]"
    yield f"# the strongest line of {sensor.raw} is at {math.sqrt(rate) / (2 * math.pi):.4g} Hz"
    low, high = f"{0.5 * rate:.4g}", f"{2 * rate:.4g}"
    yield f'w2 = {{ value = {rate:.5g}, unit = "1/s2", free = true, range = [{low}, {high}] }}'
    most = 2 * math.sqrt(rate)
    yield "# from none to critical damping"
    yield f'b = {{ value = {most / 200:.4g}, unit = "1/s", free = true, range = [0, {most:.4g}] }}'


def _natural_rate_1_s2(sensor: Signal) -> float:
    times, values = sensor.present
    step = float(np.median(np.diff(times)))
    grid = np.arange(float(times[0]), float(times[-1]), step)
    even = np.interp(grid, times, values)
    frequencies, power = signals.periodogram(even, 1 / step, "hann", detrend="linear", nfft=None)
    # A log of one or two readings has no frequency of its own but that of its rows.
    strongest = float(frequencies[1 + int(np.argmax(power[1:]))]) if len(power) > 1 else 1 / step
    return (2 * math.pi * strongest) ** 2
