"""Stated tolerances of a sensor, and the terms of its readings that they allow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# The tolerances of a sensor by their keys in a file, and the key of its range.
LINEARITY, GAIN, CLOCK = "linearity", "gain_tolerance", "clock_tolerance"
RANGE = "range"


@dataclass(frozen=True)
class Term:
    """One way in which a sensor may be off: `parameter` of the tolerance `name`.

    `width`: its standard uncertainty in `unit`. `shape`: change of each reading (samples, in the
    unit of the readings) for one unit of it.
    """

    name: str
    parameter: str
    unit: str
    width: float
    shape: Floats


@dataclass(frozen=True)
class Tolerances:
    """Stated standard uncertainties of a sensor, 0 where it is exact.

    `linearity`: of a reading at either end of the range, in the unit of the readings, beside the
    straight line of the stated gain. `gain` and `clock`: relative. `range`: the ends of the range,
    or its length, its middle then being that of what the sensor reads in a run; the readings' own
    range if None.
    """

    linearity: float = 0.0
    gain: float = 0.0
    clock: float = 0.0
    range: tuple[float, float] | float | None = None

    def __bool__(self) -> bool:
        return bool(self.linearity or self.gain or self.clock)

    def terms(self, unit: str, place: Floats, time_s: Floats | None) -> Iterator[Term]:
        """The terms of readings in `unit` that would be `place` of an exact sensor (samples).

        With u from -1 to 1 over the range, a bend is a u² + s u³. A sensor is adjusted at its
        middle, where it bends least; an S about another point has both, and both have half of the
        variance at the ends.
        """
        if self.linearity:
            u = self._of_range(place)
            each = self.linearity / math.sqrt(2)
            yield Term(LINEARITY, "arc", unit, each, u**2)
            yield Term(LINEARITY, "bend", unit, each, u**3)
        if self.gain:
            yield Term(GAIN, "gain", "1", self.gain, place)
        if self.clock and time_s is not None and len(place) > 1:
            yield Term(CLOCK, "clock", "1", self.clock, time_s * np.gradient(place, time_s))

    def _of_range(self, place: Floats) -> Floats:
        """`place` from -1 to 1 over the range."""
        low, high = float(place.min()), float(place.max())
        if isinstance(self.range, tuple):
            low, high = self.range
        elif self.range is not None:
            middle = (low + high) / 2
            low, high = middle - self.range / 2, middle + self.range / 2
        return (2 * place - low - high) / ((high - low) or 1.0)


EXACT = Tolerances()
