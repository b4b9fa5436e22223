"""Constants that an effect assumes, drawn over what the catalogue says is plausible of them."""

from __future__ import annotations

import math

from mopro.blind.cases.effects import Drawn, Generator
from mopro.effects import Parameter, catalogue
from mopro.engine.candidate import Role

# A range of more than a decade is of a size, of which no decade is likelier than another.
_DECADE = 10.0
# Mains are of 50 or 60 Hz, and of nothing between.
_ALTERNATIVES = "frequency"


def constants(name: str) -> list[Parameter]:
    """The numbers of an effect that are no size, angle or measure, and known to within a range."""
    return [
        p
        for p in catalogue()[name].parameters
        if p.response is Role.SHAPE
        and p.plausible[0] < p.plausible[1]
        and not (p.whole or p.unit_of or p.dimension == _ALTERNATIVES)
    ]


def with_constants(g: Generator, name: str, drawn: Drawn) -> Drawn:
    """`drawn`, with the effect's constants anywhere in their plausible ranges."""
    values = {p.name: _within(g, *p.plausible) for p in constants(name)}
    return lambda s: {**drawn(s), **values}


def _within(g: Generator, low: float, high: float) -> float:
    if low > 0 and high > _DECADE * low:
        return math.exp(g.uniform(math.log(low), math.log(high)))
    return float(g.uniform(low, high))
