"""Formulas in files, and effects that are written as formulas: a term and where it enters."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mopro.errors import ModelError
from mopro.formula.dimension import Dimension, dimension_in, factor_of, words
from mopro.formula.evaluate import evaluate
from mopro.formula.expressions import Formula, FormulaError, check_names, parse
from mopro.tomlfile import Value

# Roles of a parameter, as a file states them.
AMPLITUDE, SHAPE, PERIOD, THRESHOLD = ROLES = ("amplitude", "shape", "period", "threshold")
# Where the term of an effect is added, of machines of several kinds.
COMMAND, MEASUREMENT, FORCE, FRICTION = "command", "measurement", "force", "friction"


@dataclass(frozen=True)
class Written:
    """A formula and the value of a file that holds it."""

    formula: Formula
    value: Value | None = field(default=None, compare=False)

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
class EffectParameter:
    """A parameter of an effect, in `unit`.

    `low`, `high` and `start` are numbers in that unit, or formulas (SI) of the sizes of the
    data; None where they are taken from what the term does to these data. `value`: where a user's
    file states it.
    """

    name: str
    unit: str
    role: str = AMPLITUDE
    low: float | Formula | None = None
    high: float | Formula | None = None
    start: float | Formula | None = None
    positive: bool = False
    value: Value | None = field(default=None, compare=False)

    @cached_property
    def factor(self) -> float:
        """The unit in SI."""
        return factor_of(self.unit)

    def sized(self, size: float | Formula, sizes: Mapping[str, float]) -> float:
        """A number, or what a formula of `sizes` (SI) comes to, in the parameter's unit.

        ModelError for a user's formula that has other names, or no finite value.
        """
        if isinstance(size, float):
            return size
        try:
            check_names(size, sizes)
        except FormulaError as error:
            raise self._refused(size, str(error)) from error
        found = float(evaluate(size, sizes, np.zeros(1))[0]) / self.factor
        if self.value is not None and not math.isfinite(found):
            raise self._refused(size, "it gives no finite number for these data")
        return found

    def _refused(self, size: Formula, message: str) -> ModelError:
        if self.value is None:
            raise AssertionError(f"{size.text}: {message}")
        return self.value.error(f"{size.text}: {message}", "bad-formula")

    def begun(self, sizes: Mapping[str, float]) -> float | None:
        """The stated start, in the unit; None without any. ModelError as for `sized`."""
        if self.start is None:
            return None
        found = self.sized(self.start, sizes)
        if self.value is not None and self.role == AMPLITUDE and found == 0:
            message = f"{self.name} cannot start at 0, where the effect is off"
            raise self.value.error(message, "bad-value", "state another start, or none")
        return found


@dataclass(frozen=True)
class WrittenEffect:
    """An effect as a term that is added where it `enters`; the catalogue's and a user's alike.

    `target`: the one input or sensor that it is for, "" for all. `form` and `extends` as those
    of a candidate of the diagnosis. `own`: it is of the user's file. `driven`: of a machine
    that has an input. `rotary`: of an axis that makes a whole turn, `angular`: of one whose place
    is an angle. `of`: the variable of a free-form term, which no catalogue lists. `crosses`: the
    input that it finds a share of in a sensor. `unconfirmed`: it is the draft of a diagnosis.
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
    rotary: bool = False
    of: str = ""
    value: Value | None = field(default=None, compare=False)
    angular: bool = False
    crosses: str = ""
    unconfirmed: bool = False


def toml_lines(effect: WrittenEffect) -> list[str]:
    """The section `[[effect]]` that states an effect of a file, without its comments."""
    assert effect.value is not None, "it was read from a file"
    return ["[[effect]]", *(f"{key} = {_toml(data)}" for key, data in effect.value.data.items())]


def _toml(data: Any) -> str:
    """Text, number, truth, or a list or table of them, in one line."""
    if isinstance(data, dict):
        return f"{{ {', '.join(f'{key} = {_toml(own)}' for key, own in data.items())} }}"
    if isinstance(data, list):
        return f"[{', '.join(map(_toml, data))}]"
    if not isinstance(data, str | bool):
        return repr(data)
    return json.dumps(data, ensure_ascii=False).replace("\x7f", "\\u007f")
