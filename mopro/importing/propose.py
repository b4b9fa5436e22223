"""The experiment that a log is proposed to be: kind of machine, command, inputs, sensors, noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mopro.errors import DataError
from mopro.formula import dimension_of_unit
from mopro.importing.roles import Signal
from mopro.instruments.agreement import Agreement, agreement
from mopro.logs import Decision
from mopro.logs.column_names import is_command
from mopro.logs.log import Floats
from mopro.noise import NoiseReport, TooShort, level_between, report, step_of, stuck_of

KINDS = ("kinematic", "axis", "thermal", "sawyer")
_AXES_OF_SAWYER = 2
_A_PAIR = 2
_METRE, _COUNT = map(dimension_of_unit, ("m", "count"))


@dataclass(frozen=True)
class Wishes:
    """Facts that the user states instead of the log: kind, commands, measured columns, units.

    `units`: by column, as people write them.
    """

    kind: str | None = None
    commands: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Noise:
    """Noise of a sensor to state: a report, or why there is none.

    Without a report `step` is the converter's, and `between` the level that readings of a smooth
    motion leave between neighbours; 0 if there is none. `stuck` are index ranges of readings that
    do not change as the others do.
    """

    found: NoiseReport | None
    reason: str
    step: float = 0.0
    between: float = 0.0
    stuck: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Proposal:
    """The experiment: `relations` holds how each sensor follows the command, by label.

    `decisions` are those about the log as a whole; those about a column stand in its signal.
    """

    kind: str
    command: Signal | None
    inputs: tuple[Signal, ...]
    sensors: tuple[Signal, ...]
    unused: tuple[Signal, ...]
    noises: dict[str, Noise]
    relations: dict[str, Agreement]
    decisions: tuple[Decision, ...] = field(default=())

    @property
    def signals(self) -> list[Signal]:
        command = [] if self.command is None else [self.command]
        return [*command, *self.inputs, *self.sensors, *self.unused]


def propose(source: str, signals: Sequence[Signal], wishes: Wishes) -> Proposal:
    """The experiment of these signals; DataError where the log does not say what it is about."""
    _check_units(source, signals)
    signals = _places_in_volts(signals, wishes)
    kind, reason = _kind(source, signals, wishes.kind)
    command, sensors = _pair(kind, signals)
    if not sensors:
        raise _nothing_measured(source, kind, signals)
    inputs = _inputs(kind, signals)
    used = {s.label for s in (*sensors, *inputs, *([command] if command else []))}
    unused = tuple(_unused(s, sensors) for s in signals if s.label not in used)
    relations = {} if command is None else _relations(command, sensors)
    decisions = (Decision("kind of machine", kind, reason), *_moves(command))
    noises = {sensor.label: noise_of(sensor) for sensor in sensors}
    return Proposal(
        kind, command, tuple(inputs), tuple(sensors), unused, noises, relations, decisions
    )


def _check_units(source: str, signals: Sequence[Signal]) -> None:
    """DataError where a column that the user named is of no unit or quantity that is known."""
    for one in signals:
        if one.role != "unused" and (one.unit is None or one.quantity is None):
            message = f"{source}: {one.raw} is used {one.reason}, and its unit is not stated"
            hint = f"state it, such as --unit {one.raw}=mm (or deg, count, rpm, A, V, C, ...)"
            raise DataError(f"{message}: {hint}", "which-unit")


def _places_in_volts(signals: Sequence[Signal], wishes: Wishes) -> list[Signal]:
    """The signals, with a stated command and measurement in V as places: those of a transducer."""
    stated = [s for s in signals if s.raw in (*wishes.commands, *wishes.sensors)]
    chosen = any(s.raw in wishes.commands for s in stated)
    if not chosen or any(s.quantity != "voltage" for s in stated) or len(stated) < _A_PAIR:
        return list(signals)
    roles = {s.label: "command" if s.raw in wishes.commands else "sensor" for s in stated}
    return [
        replace(s, quantity="position", role=roles[s.label]) if s.label in roles else s
        for s in signals
    ]


def _nothing_measured(source: str, kind: str, signals: Sequence[Signal]) -> DataError:
    message = f"{source}: no column is a measurement for a machine of kind {kind}"
    unitless = [s.raw for s in signals if s.unit is None and not s.stands]
    unitless = [raw for raw in unitless if not is_command(raw)] or unitless
    hint = "name one with --measured COLUMN"
    if unitless:
        hint += f", and state its unit, such as --measured {unitless[0]} --unit {unitless[0]}=mm"
    return DataError(f"{message}; {hint}", "which-columns")


def _kind(source: str, signals: Sequence[Signal], wished: str | None) -> tuple[str, str]:
    if wished is not None:
        return wished, "as stated with --kind"
    sensors = [s for s in signals if s.role == "sensor"]
    commands = [s for s in signals if s.role == "command"]
    moving = [s for s in sensors if s.is_place or s.is_speed]
    if moving and any(s.is_place for s in commands):
        return "kinematic", "a commanded place and a measured motion are there"
    if moving and any(s.role == "input" for s in signals):
        return "axis", f"{moving[0].raw} is measured and a force, current or duty drives it"
    if moving and any(s.is_speed for s in commands):
        return "axis", f"{moving[0].raw} is measured and follows a commanded speed"
    if not moving and any(s.is_warmth for s in sensors):
        return "thermal", "only temperatures are measured"
    if not moving:
        return "kinematic", "nothing else is known"
    message = (
        f"{source}: {moving[0].raw} is measured, and there is no command and nothing that drives it"
    )
    hint = (
        "say which it is: --kind axis (it moves freely) or --kind kinematic (it should stand"
        " still, or its command is another column: --command COLUMN)"
    )
    raise DataError(f"{message}; {hint}", "which-kind")


def _pair(kind: str, signals: Sequence[Signal]) -> tuple[Signal | None, list[Signal]]:
    """The command, and the sensors that belong to it by their names and their units."""
    sensors = [s for s in signals if s.role == "sensor" and _suits(kind, s)]
    commands = [s for s in signals if s.role == "command" and s.is_place]
    if kind == "sawyer":
        lengths = [s for s in commands if s.dimension == _METRE]
        return (lengths[0] if lengths else None), sensors[:_AXES_OF_SAWYER]
    if kind == "thermal":
        return None, sensors
    if kind == "axis" or not commands:
        return None, _of_one_axis(sensors)
    for command in commands:
        own = [s for s in sensors if s.stem == command.stem and s.quantity == command.quantity]
        if own:
            return command, _of_one_axis(own)
    own = [s for s in sensors if s.unit_word == commands[0].unit_word]
    alike = [s for s in sensors if s.dimension == commands[0].dimension and s not in own]
    rest = [s for s in sensors if s not in own and s not in alike]
    return commands[0], _of_one_axis([*own, *alike, *rest])


def _of_one_axis(sensors: Sequence[Signal]) -> list[Signal]:
    """The sensors that may read one axis: that of the first place, else of the first speed."""
    places = [s for s in sensors if s.is_place]
    speeds = [s for s in sensors if s.is_speed]
    if not places:
        return [s for s in speeds if s.dimension == speeds[0].dimension]
    first = places[0]
    rate = dimension_of_unit(f"{first.unit_word}/s")
    return [s for s in places if _same_axis(first, s)] + [s for s in speeds if s.dimension == rate]


def _same_axis(one: Signal, other: Signal) -> bool:
    """True if one place is the other but for known units: a step is no count."""
    counted = one.dimension == _COUNT and one.unit != other.unit
    return one.dimension == other.dimension and not counted


def _suits(kind: str, signal: Signal) -> bool:
    if kind == "thermal":
        return signal.is_warmth
    if kind == "sawyer":
        return signal.is_place and signal.dimension == _METRE
    return signal.is_place or signal.is_speed


def _inputs(kind: str, signals: Sequence[Signal]) -> list[Signal]:
    """Signals that drive a machine of a kind: efforts, or for want of them a commanded speed."""
    if kind not in ("axis", "thermal"):
        return []
    inputs = [s for s in signals if s.role == "input"]
    speeds = [s for s in signals if s.role == "command" and s.is_speed]
    return inputs or (speeds[:1] if kind == "axis" else [])


def _unused(signal: Signal, sensors: Sequence[Signal]) -> Signal:
    """The signal as it stays in the data without being used."""
    if signal.role == "unused":
        return signal
    article = "an" if signal.role == "input" else "a"
    reason = f"{signal.reason}; it could be {article} {signal.role}"
    if signal.role == "sensor" and (signal.is_place or signal.is_speed):
        reason += (
            f" of another axis than {sensors[0].raw}: --measured {signal.raw} takes it instead"
        )
    return replace(signal, role="unused", reason=reason)


def _relations(command: Signal, sensors: Sequence[Signal]) -> dict[str, Agreement]:
    relations = {}
    commanded_s, commanded = command.present
    for sensor in sensors:
        seen_s, seen = sensor.present
        pair = (commanded_s, commanded * command.si, seen_s, seen * sensor.si)
        found = agreement(*pair, command.held)
        if found is not None:
            relations[sensor.label] = found
    return relations


def noise_of(sensor: Signal) -> Noise:
    """The noise of a sensor to state."""
    times, values = sensor.present
    try:
        found, stuck = _report(times, values)
    except TooShort as error:
        return Noise(None, str(error), step_of(values), level_between(values))
    if found.wanders:
        reason = "the column wanders as long as it was watched: does it stand still?"
        return Noise(None, reason, found.step, level_between(values))
    stretches = len(found.stretches)
    low, high = found.rms.low, found.rms.high
    where = f"{found.readings} readings in {stretches} standstill{'s' if stretches > 1 else ''}"
    return Noise(found, f"{where}, 95 %: {low:.3g} to {high:.3g}", stuck=stuck)


def _report(times: Floats, values: Floats) -> tuple[NoiseReport, tuple[tuple[int, int], ...]]:
    """The noise at standstill, without stretches that are stuck, and these."""
    try:
        found = report(times, values)
        return found, found.stuck
    except TooShort:
        stuck = stuck_of(values)
        kept = np.ones(len(values), dtype=bool)
        for start, end in stuck:
            kept[start:end] = False
        if not stuck or not kept.any():
            raise
        found = report(times[kept], values[kept])
        return found, () if found.hidden else tuple(stuck)


def _moves(command: Signal | None) -> list[Decision]:
    if command is None:
        return []
    values = command.values
    if command.held:
        last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
        values = values[last]
    values = values[~np.isnan(values)]
    moving = np.concatenate(([False], np.diff(values) != 0, [False]))
    moves = int(np.count_nonzero(moving[1:] & ~moving[:-1]))
    return [Decision("moves", str(moves), f"changes of {command.raw}")]
