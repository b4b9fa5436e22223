"""The role of each column of a log: command, input, sensor, or none; each with its reason."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.formula import Dimension, dimension_of_unit, factor_of
from mopro.instruments.quantity import MEASURABLES, unit_of_column
from mopro.logs import Column, Decision, Log
from mopro.logs.column_names import is_command, known_units, quantity_of, unit_of, words_of
from mopro.logs.log import Floats

# Unit of a log -> suffix that is written instead, factor, offset: an experiment's temperatures are
# in °C, and a motor's constant is one of A or V.
_CONVERSIONS = {
    "%": ("percent", 1.0, 0.0), "mA": ("A", 1e-3, 0.0), "mV": ("V", 1e-3, 0.0),
    "K": ("C", 1.0, -273.15), "F": ("C", 5 / 9, -160 / 9),
}  # fmt: skip
_DEFAULTS = {"duty": "duty"}
_COUNTED = ("count", "step")
# Characters of a name without its unit: a formula takes no more than 40.
_LONGEST_NAME = 32
_PLACES = ("position", "angle")
_WARM = ("temperature",)
_SPEED = "speed"
_INPUTS = ("force", "torque", "current", "voltage", "duty", "power")
_POWER_UNITS = ("W",)
# Of the steps between rows, those that change a held value at most.
_HELD_CHANGES = 0.2
# Blank cells in a row that are a rest; a reading that was lost leaves one or two.
_SHORTEST_REST = 5


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
    def stands(self) -> bool:
        """True if no two readings differ."""
        values = self.present[1]
        return not len(values) or bool(np.ptp(values) == 0)

    @property
    def unit_word(self) -> str:
        """The unit as files write it beside a key, such as m/s for a column `..._m_s`."""
        return unit_of_column(self.unit or "") or "1"

    @property
    def si(self) -> float:
        """The unit's size in SI; 1 for a count, and without a unit."""
        return 1.0 if self.is_warmth else factor_of(self.unit_word)

    @property
    def dimension(self) -> Dimension:
        return dimension_of_unit(self.unit_word)

    def at(self, times_s: Floats) -> Floats:
        """Values at other times: those that hold until the next row, or between two rows."""
        known_s, values = self.present
        if not self.held:
            return np.interp(times_s, known_s, values)
        rows = np.clip(np.searchsorted(known_s, times_s, side="right") - 1, 0, len(values) - 1)
        filled: Floats = values[rows]
        return filled

    @property
    def is_place(self) -> bool:
        return self.quantity in _PLACES

    @property
    def is_speed(self) -> bool:
        return self.quantity == _SPEED

    @property
    def is_warmth(self) -> bool:
        return self.quantity in _WARM

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


def stated_unit(raw: str, word: str) -> str:
    """The suffix of a unit as the user states it; DataError with the known ones."""
    unit = unit_of(word)
    if unit is None or not (unit in _CONVERSIONS or unit_of_column(unit)):
        known = ", ".join(u for u in known_units() if u in _CONVERSIONS or unit_of_column(u))
        raise DataError(f"{raw}={word}: '{word}' is no unit; known are {known}", "wrong-unit")
    return unit


def signals_of(log: Log, chosen: Chosen, shift_s: dict[str, float]) -> list[Signal]:
    """The columns of `log` with their roles; times of each clock begin at `shift_s`."""
    labels: set[str] = set()
    return [_signal(log, column, chosen, shift_s, labels) for column in log.columns]


def _signal(
    log: Log, column: Column, chosen: Chosen, shift_s: dict[str, float], labels: set[str]
) -> Signal:
    unit, values, converted = _converted(column)
    quantity = quantity_of(column.name, column.unit)
    named = column.raw in (*chosen.commands, *chosen.sensors) or is_command(column.name)
    if quantity is None and named and unit in _COUNTED:
        quantity = "position"
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
    if column.unit and unit_of_column(column.unit):
        return column.unit, column.values, f"in {column.unit}"
    how = f"state it with --unit {column.raw}=UNIT"
    return None, column.values, f"without a unit that an experiment knows: {how}"


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
        role = "input" if signal.quantity in _INPUTS else "command"
        return replace(signal, role=role, held=held, reason="as stated with --command")
    if column.raw in chosen.sensors:
        return replace(signal, role="sensor", reason="as stated with --measured")
    driven = signal.quantity in _INPUTS and signal.unit is not None and values[0] != 0
    if np.ptp(values) == 0 and not driven:
        return replace(signal, held=True, reason=f"it is {values[0]:.6g} throughout")
    role, reason = _by_name(signal, column, bool(chosen.commands), bool(chosen.sensors))
    return replace(signal, role=role, reason=reason, held=held and role != "sensor")


def _fits(signal: Signal) -> bool:
    """True if the unit is one of the quantity: `speed_count` is no speed."""
    measurable = MEASURABLES.get(signal.quantity or "")
    units = measurable.units if measurable else _POWER_UNITS
    return signal.dimension in map(dimension_of_unit, units)


def _by_name(signal: Signal, column: Column, commands: bool, sensors: bool) -> tuple[str, str]:
    words = f"{signal.quantity} {signal.reason}" if signal.quantity else signal.reason
    if signal.quantity is None:
        return "unused", f"{words}: neither its name nor its unit says what it is"
    if signal.unit is None:
        return "unused", words
    if not _fits(signal):
        return "unused", f"{words}: no unit of that"
    if is_command(column.name) or signal.quantity == "duty":
        if signal.is_place and commands:
            return "unused", "another column was stated with --command"
        role = "input" if signal.quantity in _INPUTS else "command"
        return role, f"{words}; its name says that it is what the machine was told"
    if sensors:
        if signal.quantity in _INPUTS:
            return "input", words
        return "unused", "other columns were stated with --measured"
    if signal.quantity in _INPUTS:
        return "input", words
    return "sensor", words


def _holds(values: Floats) -> bool:
    """True if the column has readings on changes only, or seldom changes."""
    blank = np.isnan(values)
    present = values[~blank]
    if len(present) < len(values) / 2:
        return True
    changes = float(np.mean(np.diff(present) != 0))
    return changes < _HELD_CHANGES or (changes == 1.0 and _rests(blank))


def _rests(blank: NDArray[np.bool_]) -> bool:
    """True if blank cells come in long runs, as in a log of changes of what moves and rests."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], blank, [False])).astype(int)))
    lengths = edges[1::2] - edges[::2]
    return bool(len(lengths) and np.median(lengths) >= _SHORTEST_REST)


def decision_of(signal: Signal) -> Decision:
    """The signal's role as a decision of the import."""
    return Decision(f"column {signal.raw}", signal.role, signal.reason, signal.check)
