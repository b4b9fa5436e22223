"""The experiment that a log is proposed to be: kind of machine, command, inputs, sensors, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mopro.errors import DataError
from mopro.importing.agreement import Agreement, agreement
from mopro.importing.roles import Signal
from mopro.logs import Decision
from mopro.noise import NoiseReport, TooShort, level_between, report, step_of

KINDS = ("kinematic", "axis", "thermal", "sawyer")
_AXES_OF_SAWYER = 2


@dataclass(frozen=True)
class Wishes:
    """Facts that the user states instead of the log: kind, commands, measured columns."""

    kind: str | None = None
    commands: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()


@dataclass(frozen=True)
class Noise:
    """Noise of a sensor to state: a report, or why there is none.

    Without a report `step` is the converter's, and `between` the level that readings of a smooth
    motion leave between neighbours; 0 if there is none.
    """

    found: NoiseReport | None
    reason: str
    step: float = 0.0
    between: float = 0.0


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
    kind, reason = _kind(source, signals, wishes.kind)
    command, sensors = _pair(kind, signals)
    if not sensors:
        message = f"{source}: no column is a measurement for a machine of kind {kind}"
        hint = "name one with --measured COLUMN; its heading must state a unit, such as pos [mm]"
        raise DataError(f"{message}; {hint}", "which-columns")
    inputs = _inputs(kind, signals)
    used = {s.label for s in (*sensors, *inputs, *([command] if command else []))}
    unused = tuple(_unused(s) for s in signals if s.label not in used)
    relations = {} if command is None else _relations(command, sensors)
    decisions = (Decision("kind of machine", kind, reason), *_moves(command))
    noises = {sensor.label: _noise(sensor) for sensor in sensors}
    return Proposal(
        kind, command, tuple(inputs), tuple(sensors), unused, noises, relations, decisions
    )


def _kind(source: str, signals: Sequence[Signal], wished: str | None) -> tuple[str, str]:
    if wished is not None:
        return wished, "as stated with --kind"
    sensors = [s for s in signals if s.role == "sensor"]
    places = [s for s in sensors if s.is_place or s.quantity == "speed"]
    if places and any(s.role == "command" and s.is_place for s in signals):
        return "kinematic", "a commanded and a measured position are there"
    if places and any(s.role == "input" for s in signals):
        return "axis", f"{places[0].raw} is measured and a force, current or duty drives it"
    if sensors and not places:
        return "thermal", "only temperatures are measured"
    if not places:
        return "kinematic", "nothing else is known"
    message = (
        f"{source}: {places[0].raw} is measured, and there is no command and nothing that drives it"
    )
    hint = (
        "say which it is: --kind axis (it moves freely) or --kind kinematic (it should stand"
        " still, or its command is another column: --command COLUMN)"
    )
    raise DataError(f"{message}; {hint}", "which-kind")


def _pair(kind: str, signals: Sequence[Signal]) -> tuple[Signal | None, list[Signal]]:
    """The command, and the sensors that belong to it by their names."""
    sensors = [s for s in signals if s.role == "sensor" and _suits(kind, s)]
    commands = [s for s in signals if s.role == "command" and s.is_place]
    if kind in ("axis", "thermal") or not commands:
        return None, sensors
    if kind == "sawyer":
        return commands[0], sensors[:_AXES_OF_SAWYER]
    for command in commands:
        own = [s for s in sensors if s.stem == command.stem and s.quantity == command.quantity]
        if own:
            return command, own
    return commands[0], sensors


def _suits(kind: str, signal: Signal) -> bool:
    if kind == "thermal":
        return signal.is_warmth
    if kind in ("kinematic", "sawyer"):
        return signal.is_place
    return not signal.is_warmth


def _inputs(kind: str, signals: Sequence[Signal]) -> list[Signal]:
    return [s for s in signals if s.role == "input"] if kind in ("axis", "thermal") else []


def _unused(signal: Signal) -> Signal:
    """The signal as it stays in the data without being used."""
    if signal.role == "unused":
        return signal
    reason = f"{signal.reason}; it could be a {signal.role}"
    return replace(signal, role="unused", reason=reason)


def _relations(command: Signal, sensors: Sequence[Signal]) -> dict[str, Agreement]:
    relations = {}
    told_s, told = command.present
    for sensor in sensors:
        seen_s, seen = sensor.present
        found = agreement(told_s, told * command.si, seen_s, seen * sensor.si, command.held)
        if found is not None:
            relations[sensor.label] = found
    return relations


def _noise(sensor: Signal) -> Noise:
    times, values = sensor.present
    try:
        found = report(times, values)
    except TooShort as error:
        return Noise(None, str(error), step_of(values), level_between(values))
    if found.wanders:
        reason = "the column wanders as long as it was watched: does it stand still?"
        return Noise(None, reason, found.step, level_between(values))
    stretches = len(found.stretches)
    low, high = found.rms.low, found.rms.high
    where = f"{found.readings} readings in {stretches} standstill{'s' if stretches > 1 else ''}"
    return Noise(found, f"{where}, 95 %: {low:.3g} to {high:.3g}")


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
