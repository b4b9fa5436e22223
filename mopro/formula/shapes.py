"""Shapes of a term - periods, widths, thresholds - with ranges and starts from the data's sizes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import or_
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import TOLERANCE
from mopro.engine.candidate import Parameter, Role
from mopro.engine.spectrum import grid_step
from mopro.formula.dimension import Dimension, dimension_of_unit
from mopro.formula.evaluate import Floats
from mopro.formula.written import MEASUREMENT, PERIOD, THRESHOLD, EffectParameter, WrittenEffect

TIME = dimension_of_unit("s")
# A shape without a range: shares of the span of the quantity of its unit, and where it starts.
_SHAPES, _SHAPE_STARTS = (0.01, 1.0), (0.05, 0.25)
# Longest and shortest period that is looked for: in the span of its variable, of which it takes
# nearly two to be told from a bend (an axis may make just two turns), and in steps of it.
# Samples are even in time: from two of them on, less what tells a line from its mirror image, they
# show a line as it is.
MOST_PERIODS_OF_SPAN, _SHORTEST_STEPS, _SHORTEST_INTERVALS = 0.55, 4.0, 2 * (1 + TOLERANCE)
# A slow motion has rounding errors that are a function of place, with a period of one count.
_SHORTEST_COUNTS = 2.0
_PERIOD_STARTS = (0.05, 0.15, 0.4)
# Share of the span within which two places are one: a place that is visited again is off by
# rounding.
_SAME_PLACE = 1e-6
_SHAPE_DIFFERENCE = 1e-5


@dataclass(frozen=True)
class Extent:
    """Longest span of a signal in a run, and shortest step of it by which samples show a period."""

    span: float = 0.0
    step: float = math.inf

    def __or__(self, other: Extent) -> Extent:
        return Extent(max(self.span, other.span), min(self.step, other.step))


@dataclass(frozen=True)
class Sized:
    """Sizes of the data, from which ranges of parameters follow.

    `names`: those that formulas of a range may use. `along`: the extent (SI) of each signal along
    the runs, by dimension and name; `read`: that of the samples that a sensor was read at, in
    whatever order their places were visited. `counts`: the step (SI) of the finest converter that
    reads a quantity of a dimension.
    """

    names: Mapping[str, float]
    along: Mapping[Dimension, Mapping[str, Extent]]
    read: Mapping[Dimension, Mapping[str, Extent]]
    counts: Mapping[Dimension, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        runs: Iterable[tuple[Mapping[str, Floats], NDArray[np.intp]]],
        dimensions: Mapping[str, Dimension | None],
        names: Mapping[str, float],
        counts: Mapping[Dimension, float] = MappingProxyType({}),
    ) -> Sized:
        """Sizes of `runs`: the signals (SI) at the rows of each, and the rows that were read."""
        along: dict[Dimension, dict[str, Extent]] = {}
        read: dict[Dimension, dict[str, Extent]] = {}
        for values, rows in runs:
            for name, own in values.items():
                dimension = dimensions.get(name)
                if dimension is not None and np.isfinite(own).all():
                    for extents, found in (
                        (along, Extent(float(np.ptp(own)), _step_along(own))),
                        (read, Extent(float(np.ptp(own[rows])), _step_between(own[rows]))),
                    ):
                        of_unit = extents.setdefault(dimension, {})
                        of_unit[name] = of_unit.get(name, Extent()) | found
        return cls(names, along, read, counts)

    def extent(self, effect: WrittenEffect, dimension: Dimension) -> Extent:
        """That of the signals of a dimension in the effect's term, or of all if it has none.

        A term of the measurement acts at the samples, any other one throughout the motion.
        """
        read = effect.enters == MEASUREMENT and dimension != TIME
        every = (self.read if read else self.along).get(dimension, {})
        own = [each for name, each in every.items() if name in effect.term.formula.names]
        return reduce(or_, own or every.values(), Extent())


def _step_along(values: Floats) -> float:
    """The median change from sample to sample (in the unit of `values`), infinite without any."""
    moved = np.abs(np.diff(values))
    moved = moved[moved > 0]
    return float(np.median(moved)) if len(moved) else math.inf


def _step_between(places: Floats) -> float:
    """The median distance of neighbouring places (in their unit), infinite where all are one.

    At least the step of a grid that they are on, where two periods look alike.
    """
    apart = np.diff(np.sort(places))
    apart = apart[apart > _SAME_PLACE * np.ptp(places)]
    return max(float(np.median(apart)), grid_step(places)) if len(apart) else math.inf


def role_of_shape(p: EffectParameter) -> Role:
    """A threshold is found on a grid: where the term jumps, no slope leads to it."""
    return Role.SEARCHED if p.role == THRESHOLD else Role.SHAPE


def shape_of(effect: WrittenEffect, p: EffectParameter, sized: Sized) -> Parameter | None:
    """A shape of an effect; None if its range is empty, as of a period that no data show."""
    dimension = dimension_of_unit(p.unit)
    extent = sized.extent(effect, dimension)
    span, step = (extent.span or 1.0) / p.factor, extent.step / p.factor
    low, high = _SHAPES[0] * span, _SHAPES[1] * span
    starts = tuple(share * span for share in _SHAPE_STARTS)
    if p.role == PERIOD:
        steps = _SHORTEST_INTERVALS if dimension == TIME else _SHORTEST_STEPS
        count = _SHORTEST_COUNTS * sized.counts.get(dimension, 0.0) / p.factor
        low, high = max(steps * step, count), MOST_PERIODS_OF_SPAN * span
        starts = tuple(share * span for share in _PERIOD_STARTS)
    if p.low is not None and p.high is not None:
        low, high = (p.sized(end, sized.names) for end in (p.low, p.high))
        starts = tuple(low + share * (high - low) for share in _SHAPE_STARTS)
    if p.role == THRESHOLD:
        # A term that is not searched for is tried at both ends.
        starts = (low, high)
    begun = p.begun(sized.names)
    if begun is not None:
        starts = (begun,)
    if not low < high:
        return None
    return Parameter(
        p.name, p.unit, low, high, tuple(min(max(s, low), high) for s in starts),
        role_of_shape(p), inverse=p.role == PERIOD and low > 0, difference=_SHAPE_DIFFERENCE,
    )  # fmt: skip
