"""Base of free-form terms: one function of one variable, with a size that is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from mopro.effects.effect import Effect, Parameter
from mopro.engine.candidate import Law
from mopro.engine.candidate import Parameter as Fitted

# The size at which a term is probed, as a share of the largest one. Near a stall the response is
# not linear; ten times less, and a ring's phase still counts.
_PROBED = 0.01


class FreeFormTerm(Effect):
    """Base of the terms of one size `c`.

    `enters`: force, heat or ambient. `of`: the variable, as in Law. `unit`: of the term's values.
    `text`: the term for c = 1, in the language of an effect that a user writes; none where
    `written` says more. `alone`: as in Law.
    """

    enters: ClassVar[str]
    of: ClassVar[str]
    unit: ClassVar[str]
    text: ClassVar[str] = ""
    alone: ClassVar[bool] = True

    @property
    def law(self) -> Law:
        return Law(self.enters, self.of, self.unit, self.written, alone=self.alone)

    def written(self, values: Mapping[str, float]) -> str:
        """The term with its numbers, as a formula."""
        return f"{values['c']:.4g} * {self.text}"

    @staticmethod
    def size(largest: float) -> Fitted:
        """The size, fitted within ± `largest`."""
        return Fitted("c", "", -largest, largest, (_PROBED * largest,))


def size(unit: str, name: str = "c") -> Parameter:
    """A size of a term, whose values in SI are `unit` for a variable in SI."""
    return Parameter(name, unit, "", 0.0, (-1e12, 1e12), -1e12, 1e12, "size of the term")
