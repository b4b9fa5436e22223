"""A stated machine: its numbers, its law, and effects as formulas."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from mopro.formula import factor_of
from mopro.formula.written import (
    COMMAND,
    FORCE,
    FRICTION,
    MEASUREMENT,
    Written,
    WrittenEffect,
)
from mopro.source import Source

KINEMATIC, AXIS, THERMAL, PYTHON = KINDS = ("kinematic", "axis", "thermal", "python")
# Where the term of an effect is added; "input" may be followed by the name of one input, and
# "measurement" by that of one sensor.
POWER, AMBIENT, INPUT = "power", "ambient", "input"
ENTERS = {
    KINEMATIC: (COMMAND, MEASUREMENT),
    AXIS: (FORCE, FRICTION, INPUT, MEASUREMENT),
    THERMAL: (POWER, AMBIENT, INPUT, MEASUREMENT),
    PYTHON: (),
}
# Where a term is a part of an equation, which is evaluated moment by moment.
IN_EQUATIONS = (FORCE, FRICTION, POWER)


@dataclass(frozen=True)
class Number:
    """A number of the model, in `unit`: fixed, known with a tolerance, or free to be fitted.

    `tolerance`: a share of the value; `note`: a note on how it was read. `before`: the value that
    fitted before effects were found, in a repaired file.
    """

    name: str
    unit: str
    value: float
    free: bool = False
    tolerance: float = 0.0
    low: float = 0.0
    high: float = 0.0
    before: float | None = None
    note: str = ""

    @cached_property
    def factor(self) -> float:
        """The unit in SI."""
        return factor_of(self.unit)


@dataclass(frozen=True)
class StatedMachine:
    """A machine whose equations a file states; `unit`: of its axis, "" until a sensor tells it.

    `laws`: the position of a kinematic machine, the acceleration of an axis, or the rate (the
    power) of each thermal node, by name. `active`: values of the effects that its file switches
    on, in the units of their parameters, or in those of `units` where the file states any. `runs`:
    of those that belong to certain runs alone, the names of these runs' data files, each with its
    checksum. `python`: file and function of a foreign model. `kind_only`: no more of it was stated,
    and its numbers are yet to be taken from the data.
    """

    name: str
    kind: str
    unit: str
    numbers: Mapping[str, Number]
    laws: Mapping[str, Written]
    effects: tuple[WrittenEffect, ...]
    active: Mapping[str, Mapping[str, float]]
    source: Source
    python: tuple[str, str] | None = None
    runs: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    kind_only: bool = False
    units: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @cached_property
    def factor(self) -> float:
        """The unit of the axis in SI."""
        return factor_of(self.unit or "1")

    def without_effects(self, kept: Collection[str]) -> StatedMachine:
        """This machine as it was before it was repaired, with the effects `kept` only."""
        numbers = {
            name: n if n.before is None else replace(n, value=n.before)
            for name, n in self.numbers.items()
        }
        active = {name: own for name, own in self.active.items() if name in kept}
        return replace(self, numbers=numbers, active=active)

    def beside(self, effects: Iterable[WrittenEffect]) -> StatedMachine:
        """This machine with `effects`, which take the place of its own of the same names."""
        added = tuple(effects)
        names = {effect.name for effect in added}
        kept = tuple(effect for effect in self.effects if effect.name not in names)
        return replace(self, effects=kept + added)

    @property
    def nodes(self) -> tuple[str, ...]:
        """The thermal nodes; none for another kind."""
        return tuple(self.laws) if self.kind == THERMAL else ()
