"""A machine of another kind than the motor: its numbers, its law, and effects as formulas."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from mopro.errors import ModelError
from mopro.formula import Dimension, Formula, FormulaError, factor_of
from mopro.formula.dimension import dimension_in, words
from mopro.formula.language import check_names, parse
from mopro.source import Source
from mopro.tomlfile import Value

KINEMATIC, AXIS, THERMAL, PYTHON = KINDS = ("kinematic", "axis", "thermal", "python")
# Where the term of an effect is added; "input" may be followed by the name of one input, and
# "measurement" by that of one sensor.
COMMAND, MEASUREMENT, FORCE, FRICTION = "command", "measurement", "force", "friction"
POWER, AMBIENT, INPUT = "power", "ambient", "input"
ENTERS = {
    KINEMATIC: (COMMAND, MEASUREMENT),
    AXIS: (FORCE, FRICTION, INPUT, MEASUREMENT),
    THERMAL: (POWER, AMBIENT, INPUT, MEASUREMENT),
    PYTHON: (),
}
# Where a term is a part of an equation, which is evaluated moment by moment.
IN_EQUATIONS = (FORCE, FRICTION, POWER)
AMPLITUDE, SHAPE, PERIOD = ROLES = ("amplitude", "shape", "period")


@dataclass(frozen=True)
class Written:
    """A formula and the value of a file that holds it."""

    formula: Formula
    value: Value | None = None

    @staticmethod
    def of(text: str) -> Written:
        return Written(parse(text))

    def check(
        self, names: Mapping[str, Dimension | None], wanted: Dimension | None, what: str
    ) -> None:
        """ModelError for a name that is not in `names`, and for units that do not match."""
        try:
            check_names(self.formula, names)
        except FormulaError as error:
            raise self.error(error, "unknown-name") from error
        try:
            found = dimension_in(self.formula, names)
            if wanted is not None and found is not None and found != wanted:
                message = f"the formula gives {words(found)}, and {what} is in {words(wanted)}"
                raise FormulaError(message, 0, len(self.formula.text))
        except FormulaError as error:
            raise self.error(error, "wrong-unit") from error

    def error(self, error: FormulaError, rule: str) -> ModelError:
        if self.value is None:
            raise AssertionError(f"{self.formula.text}: {error}") from error
        return self.value.error_inside(str(error), error.start, error.end, rule)


@dataclass(frozen=True)
class Number:
    """A number of the model, in `unit`: fixed, known with a tolerance, or free to be fitted.

    `before`: the value that fitted before effects were found, in a repaired file.
    """

    name: str
    unit: str
    value: float
    free: bool = False
    tolerance: float = 0.0
    low: float = 0.0
    high: float = 0.0
    before: float | None = None

    @cached_property
    def factor(self) -> float:
        """The unit in SI."""
        return factor_of(self.unit)


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect, in `unit`.

    `low`, `high` and `start` are numbers in that unit, or formulas (SI) of the sizes of the
    data; None where they are taken from what the term does to these data.
    """

    name: str
    unit: str
    role: str = AMPLITUDE
    low: float | Formula | None = None
    high: float | Formula | None = None
    start: float | Formula | None = None
    positive: bool = False

    @cached_property
    def factor(self) -> float:
        """The unit in SI."""
        return factor_of(self.unit)


@dataclass(frozen=True)
class Effect:
    """An effect as a term that is added where it `enters`; the catalogue's and a user's alike.

    `target`: the one input or sensor that it is for, "" for all. `form` and `extends` as those
    of a candidate of the diagnosis. `own`: it is of the user's file. `driven`: of a machine
    that has an input.
    """

    name: str
    enters: str
    target: str
    term: Written
    parameters: tuple[EffectParameter, ...]
    form: str = ""
    extends: str | None = None
    own: bool = False
    driven: bool = False
    value: Value | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Rig:
    """A machine of another kind; `unit` is that of its axis ("" until a sensor tells it).

    `laws`: the position of a kinematic machine, the acceleration of an axis, or the rate (the
    power) of each thermal node, by name. `active`: values of the effects that its file switches
    on, in the units of their parameters. `python`: file and function of a foreign model.
    """

    name: str
    kind: str
    unit: str
    numbers: Mapping[str, Number]
    laws: Mapping[str, Written]
    effects: tuple[Effect, ...]
    active: Mapping[str, Mapping[str, float]]
    source: Source
    python: tuple[str, str] | None = None

    def without_effects(self, kept: Collection[str]) -> Rig:
        """This machine as it was before it was repaired, with the effects `kept` only."""
        numbers = {
            name: n if n.before is None else replace(n, value=n.before)
            for name, n in self.numbers.items()
        }
        active = {name: own for name, own in self.active.items() if name in kept}
        return replace(self, numbers=numbers, active=active)

    @property
    def nodes(self) -> tuple[str, ...]:
        """The thermal nodes; none for another kind."""
        return tuple(self.laws) if self.kind == THERMAL else ()
