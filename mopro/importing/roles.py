"""The role of each column of a log: command, input, sensor, or none; each with its reason."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.logs import Column, Decision, Log
from mopro.logs.names import is_command, quantity_of, words_of

Floats = NDArray[np.float64]

# Unit of a log -> suffix that an experiment knows, factor, offset.
_CONVERSIONS = {
    "%": ("percent", 1.0, 0.0), "mA": ("A", 1e-3, 0.0), "mV": ("V", 1e-3, 0.0),
    "K": ("C", 1.0, -273.15), "rpm": ("rad_s", 2 * np.pi / 60, 0.0),
    "deg_s": ("rad_s", np.pi / 180, 0.0), "mm_s": ("m_s", 1e-3, 0.0), "in_s": ("m_s", 0.0254, 0.0),
    "lbf": ("N", 4.4482216152605, 0.0),
}  # fmt: skip
# Suffix of an experiment -> its size in SI; a count has none.
_SI = {
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "rad": 1.0, "mrad": 1e-3,
    "deg": np.pi / 180, "arcsec": np.pi / 648_000, "count": 1.0, "m_s": 1.0, "rad_s": 1.0,
    "N": 1.0, "Nm": 1.0, "A": 1.0, "V": 1.0, "duty": 1.0, "percent": 0.01, "C": 1.0,
}  # fmt: skip
_KNOWN = _SI.keys()
_DEFAULTS = {"duty": "duty"}
# Characters of a name without its unit: a formula takes no more than 40.
_LONGEST_NAME = 32
_PLACES = ("position", "angle")
_WARM = ("temperature",)
_PUSHES = ("force", "torque")
_INPUTS = ("force", "torque", "current", "voltage", "duty")
# Of the steps between rows, those that change a held value at most.
_HELD_CHANGES = 0.2


@dataclass(frozen=True)
class Signal:
    """A column as the experiment uses it.

    `label` is its name in the normalised data, which ends in `unit` (None if it is unknown);
    `values` (n, NaN where there is none) are in it, at `time_s`. `role` is command, input, sensor
    or unused, `held` true if the value holds until the next row.
    """

    raw: str
    label: str
    quantity: str | None
    unit: str | None
    role: str
    reason: str
    time_s: Floats
    values: Floats
    clock: str
    held: bool = False
    check: bool = False

    @property
    def present(self) -> tuple[Floats, Floats]:
        """Times and values of the rows that have one."""
        rows = ~np.isnan(self.values)
        return self.time_s[rows], self.values[rows]

    @property
    def si(self) -> float:
        """The unit's size in SI; 1 for a count, and without a unit."""
        return _SI.get(self.unit or "", 1.0)

    @property
    def is_place(self) -> bool:
        return self.quantity in _PLACES

    @property
    def is_warmth(self) -> bool:
        return self.quantity in _WARM

    @property
    def is_push(self) -> bool:
        """True for a force and a torque, which move an axis without a motor's constant."""
        return self.quantity in _PUSHES

    @property
    def stem(self) -> list[str]:
        """Words of the name without those of its role and quantity, to pair columns by."""
        skipped = {"target", "command", "cmd", "position", "pos", "setpoint", "actual", "act"}
        return [w for w in words_of(self.raw) if w not in skipped and w != self.unit]


@dataclass(frozen=True)
class Chosen:
    """Columns that the user names as commands and as sensors; none for those found by name."""

    commands: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()


def signals_of(log: Log, chosen: Chosen, shift_s: dict[str, float]) -> list[Signal]:
    """The columns of `log` with their roles; times of each clock begin at `shift_s`."""
    labels: set[str] = set()
    return [_signal(log, column, chosen, shift_s, labels) for column in log.columns]


def _signal(
    log: Log, column: Column, chosen: Chosen, shift_s: dict[str, float], labels: set[str]
) -> Signal:
    unit, values, converted = _converted(column)
    quantity = quantity_of(column.name, column.unit)
    if unit is None and quantity in _DEFAULTS:
        unit = _DEFAULTS[quantity]
    signal = Signal(
        column.raw,
        _label(column.name if unit else column.raw, unit, labels),
        quantity,
        unit,
        "unused",
        converted,
        log.time_of(column) + shift_s[column.clock],
        values,
        column.clock,
    )
    return _with_role(signal, column, chosen)


def _converted(column: Column) -> tuple[str | None, Floats, str]:
    """Unit, values in it, and the words for it."""
    if column.unit in _CONVERSIONS:
        unit, factor, offset = _CONVERSIONS[column.unit]
        change = "" if (factor, offset) == (1.0, 0.0) else f", converted from {column.unit}"
        return unit, column.values * factor + offset, f"in {unit}{change}"
    if column.unit in _KNOWN:
        return column.unit, column.values, f"in {column.unit}"
    return None, column.values, "without a unit that an experiment knows"


def _label(name: str, unit: str | None, labels: set[str]) -> str:
    """A name that a formula may use, new among `labels`."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "column"
    plain = plain[:_LONGEST_NAME]
    if plain[0].isdigit():
        plain = f"c_{plain}"
    label = plain if unit is None else f"{plain}_{unit}"
    while label in labels or label == "time_s":
        label = f"{plain}_{len(labels)}" + ("" if unit is None else f"_{unit}")
    labels.add(label)
    return label


def _with_role(signal: Signal, column: Column, chosen: Chosen) -> Signal:
    _, values = signal.present
    if len(values) < 2:
        return replace(signal, reason="it has fewer than two readings")
    held = _holds(signal.values)
    if column.raw in chosen.commands:
        return replace(signal, role="command", held=held, reason="as stated with --command")
    if column.raw in chosen.sensors:
        return replace(signal, role="sensor", reason="as stated with --measured")
    driven = signal.quantity in _INPUTS and signal.unit is not None and values[0] != 0
    if np.ptp(values) == 0 and not driven:
        return replace(signal, held=True, reason=f"it is {values[0]:.6g} throughout")
    role, reason = _by_name(signal, column, bool(chosen.commands), bool(chosen.sensors))
    return replace(signal, role=role, reason=reason, held=held and role != "sensor")


def _by_name(signal: Signal, column: Column, commands: bool, sensors: bool) -> tuple[str, str]:
    told = f"{signal.quantity} {signal.reason}" if signal.quantity else signal.reason
    if signal.quantity is None or signal.unit is None:
        return "unused", told
    if is_command(column.name) or signal.quantity == "duty":
        if signal.is_place and commands:
            return "unused", "another column was stated with --command"
        role = "command" if signal.is_place or signal.quantity == "speed" else "input"
        return role, f"{told}; its name says that it is what the machine was told"
    if sensors:
        if signal.quantity in _INPUTS:
            return "input", told
        return "unused", "other columns were stated with --measured"
    if signal.quantity in _INPUTS:
        return "input", told
    return "sensor", told


def _holds(values: Floats) -> bool:
    """True if the column has readings on changes only, or seldom changes."""
    present = values[~np.isnan(values)]
    if len(present) < len(values) / 2:
        return True
    return bool(np.mean(np.diff(present) != 0) < _HELD_CHANGES)


def decision_of(signal: Signal) -> Decision:
    """The signal's role as a decision of the import."""
    return Decision(f"column {signal.raw}", signal.role, signal.reason, signal.check)
