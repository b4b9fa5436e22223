"""Texts of an imported experiment: machine.toml and experiment.toml, each decision a comment."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scipy import signal as signals

from mopro.importing.propose import Proposal
from mopro.importing.roles import Signal, decision_of
from mopro.logs import Decision
from mopro.text import visible

_HEAD = (
    "# Written by `mopro import` from {source}.",
    "# A comment gives the reason of what follows; CHECK marks what the log does not settle.",
)
_SLOWEST_SHARE = 3.0
# Names that the formulas of some kind of machine know already.
_RESERVED = frozenset(
    ["t", "x", "v", "a", "y", "u", "T", "pi", "ambient", "exchange", "foreign", "command"]
)
_UNIT_WORDS = {"m_s": "m/s", "rad_s": "rad/s", "Nm": "N m", "percent": "%", "duty": "1"}


def experiment_text(source: str, proposal: Proposal, decisions: Sequence[Decision]) -> str:
    """The text of experiment.toml."""
    machine = "chow1992" if proposal.kind == "sawyer" else "machine.toml"
    lines = [
        *(line.format(source=_quoted(source)) for line in _HEAD),
        *_comments(decisions),
        f"machine = {_quoted(machine)}",
        "",
        *(_sawyer(proposal) if proposal.kind == "sawyer" else _foreign(proposal)),
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
    for name, one in named_inputs(proposal.inputs).items():
        yield from _comments([decision_of(one)])
        yield _input(name, one)
    for sensor in proposal.sensors:
        yield ""
        yield from _sensor(proposal, sensor)
        if proposal.kind == "kinematic" and proposal.command is None:
            yield '# drift = "free"     # CHECK: for a slow straight drift beside the command'
    yield ""
    yield "[[run]]"
    yield 'data = "data.csv"'


def unit_word(one: Signal) -> str:
    """The unit of a signal as files write it beside a key, such as m/s for a column `..._m_s`."""
    return _UNIT_WORDS.get(one.unit or "", one.unit or "1")


def _input(name: str, one: Signal) -> str:
    hold = ", hold = true" if one.held else ""
    unit = _quoted(unit_word(one))
    return f"{name} = {{ column = {_quoted(one.label)}, unit = {unit}{hold} }}"


def named_inputs(inputs: Sequence[Signal]) -> dict[str, Signal]:
    """Inputs by the names that formulas use: the quantity where it is the only one of its kind."""
    quantities = [one.quantity for one in inputs]
    return {
        str(one.quantity) if quantities.count(one.quantity) == 1 else sensor_name(one): one
        for one in inputs
    }


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
    yield f"unit = {_quoted(unit_word(sensor))}"
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
    if (proposal.command.unit == "count") != (sensor.unit == "count"):
        told = f"the command is in {proposal.command.unit}, the readings in {sensor.unit}"
        yield f"# CHECK: {told}: the scale between them is fitted"
        yield 'scale = "free"'
        return
    if not relation.related:
        reason = f"correlation {relation.correlation:.2f}"
        yield from _comments(
            [Decision("this column", "does not follow the command", reason, check=True)]
        )
    for words in relation.words():
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
        yield ""
    yield "[[run]]"
    if proposal.command is None:
        yield "# CHECK: the log has no command: name the program that ran"
        yield 'program = "PROGRAM.CMD"'
    else:
        yield from _comments([decision_of(proposal.command)])
        yield 'command = "command.csv"'
    yield 'data = "data.csv"'


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
    yield f"unit = {_quoted(unit_word(proposal.sensors[0]))}"
    if proposal.command is None:
        yield "# CHECK: the log has no command: the axis should stand still"
        yield 'position = "0"'
        return
    yield "# the axis goes where it is told: x = command"
    for relation in list(proposal.relations.values())[:1]:
        if relation.related and relation.scaled:
            yield f"# CHECK: the readings are {relation.scale:.5g} times the command; to fit that:"
            yield '# position = "gain * command"'
            yield "# [base]"
            yield f'# gain = {{ value = {relation.scale:.5g}, unit = "1", free = true }}'


def _axis(proposal: Proposal) -> Iterator[str]:
    sensor = proposal.sensors[0]
    yield f"unit = {_quoted(unit_word(sensor))}"
    if not proposal.inputs:
        yield from _free_axis(sensor)
        return
    angular = sensor.unit in ("deg", "rad", "mrad", "arcsec", "rad_s", "count")
    mass, unit = ("inertia", "kg m2") if angular else ("mass", "kg")
    drag = "N m s/rad" if angular else "N s/m"
    yield f"# {mass} * acceleration = what drives it - viscous * speed; stiffness and dry friction"
    yield "# are 0 until they are stated here."
    yield ""
    yield "[base]"
    yield "# the log does not state these: a free one is fitted within its range"
    quantities = {one.quantity for one in proposal.inputs}
    drag_line = f'viscous = {{ value = 1.0, unit = "{drag}", free = true, range = [0, 1000] }}'
    if any(one.is_push for one in proposal.inputs):
        yield f'{mass} = {{ value = 1.0, unit = "{unit}", free = true, range = [0.001, 1000] }}'
        yield drag_line
        return
    yield f"# CHECK: state the {mass}: beside it, the motion shows only ratios of the others"
    yield f'{mass} = {{ value = 1.0, unit = "{unit}" }}'
    yield drag_line
    unit = "N m/A" if angular else "N/A"
    yield f'constant = {{ value = 1.0, unit = "{unit}", free = true, range = [0.0001, 1000] }}'
    if quantities & {"voltage", "duty"}:
        yield "# CHECK: state the resistance; only its ratio to the constant shows in the motion"
        yield 'resistance = { value = 1.0, unit = "ohm" }'
    if "duty" in quantities:
        yield "# CHECK: state the supply; only its ratio to the resistance shows in the motion"
        yield 'supply = { value = 12.0, unit = "V" }'


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
    strongest = float(frequencies[1 + int(np.argmax(power[1:]))])
    return (2 * math.pi * strongest) ** 2


def _thermal(proposal: Proposal) -> Iterator[str]:
    inputs = named_inputs(proposal.inputs)
    driven = _driven(proposal, inputs)
    yield ""
    yield "# K/s of each node; `ambient` is its temperature at the start"
    yield "[nodes]"
    for sensor in proposal.sensors:
        node = sensor_name(sensor)
        gains = "".join(f"a_{name} * {name} - " for name in driven.get(node, ())) or "-"
        yield f'{node} = "{gains}U * (T - ambient)"'
    yield ""
    yield "[base]"
    sensor = proposal.sensors[0]
    times, values = sensor.present
    length = float(times[-1] - times[0])
    loss = _SLOWEST_SHARE / length
    yield f"# first guess: {_SLOWEST_SHARE:g} time constants in the {length:.4g} s of the log"
    yield _free("U", loss, "1/s")
    for name, one in inputs.items():
        largest = float(np.nanmax(np.abs(one.values))) or 1.0
        gain = float(np.ptp(values)) * loss / (largest * one.si)
        yield f"# first guess: {one.raw} warms to the highest reading of {sensor.raw}"
        yield _free(f"a_{name}", gain, "K/s" if one.quantity == "duty" else f"K/(s {one.unit})")


def _free(name: str, value: float, unit: str) -> str:
    """A base number to fit, from 0 to 30 times the first guess."""
    limits = f"range = [0, {30 * value:.4g}]"
    return f'{name} = {{ value = {value:.4g}, unit = "{unit}", free = true, {limits} }}'


def _driven(proposal: Proposal, inputs: dict[str, Signal]) -> dict[str, list[str]]:
    """Inputs of each node: the node that bears the input's number, else the first one."""
    driven: dict[str, list[str]] = {}
    for name, one in inputs.items():
        digits = [c for c in one.raw if c.isdigit()][:1]
        same = [s for s in proposal.sensors if digits and digits[0] in s.raw]
        driven.setdefault(sensor_name((same or list(proposal.sensors))[0]), []).append(name)
    return driven
