"""Derivatives of a residual that costs a simulation: differences at first, secants after."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.diagnosis.model import Floats

# Secants follow as long as they foretell a step's change to within this share of it.
_FORETOLD = 0.3
# So close to it a parameter is at an end of its range.
_EDGE = 1e-6
# Slopes closer than this to a combination of others are one.
_PARALLEL = 1e-9
# A change this small in chi-squared tells nothing of slopes.
_TOO_SMALL = 1e-2


def step_against(slopes: Floats, change: Floats) -> Floats:
    """The step of the parameters that makes up for `change` best, by `slopes` (samples x them)."""
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0] = 1.0
    step: Floats = np.linalg.lstsq(slopes / scale, -change, rcond=_PARALLEL)[0] / scale
    return step


@dataclass
class Place:
    """Parameters, the residual there, and its slopes."""

    x: Floats
    residual: Floats
    slopes: Floats


class Slopes:
    """The Jacobian (samples x parameters) of `residual`, asked for along the path of a fit.

    `differences` are the steps, one for each parameter. `corrected` tells that the last
    slopes are good for a step only, not for errors of parameters. Where a step went as its slopes
    foretold, the new ones are the old ones corrected by it (Broyden, 1965), which costs
    nothing; else they are taken anew, one evaluation a parameter. The correction is
    shared out by what each parameter contributed to the step's change.
    """

    def __init__(self, residual: Callable[[Floats], Floats], differences: Sequence[float]) -> None:
        self._residual = residual
        self._differences = differences
        self.last: Place | None = None
        self.corrected = False

    def forget(self) -> None:
        """Take the next ones anew."""
        self.last = None

    def at(self, x: Floats) -> Floats:
        here = self._residual(x)
        slopes = self._corrected(x, here)
        if slopes is None:
            slopes = self._taken(x, here)
            self.corrected = False
        self.last = Place(x.copy(), here, slopes)
        return slopes

    def promise(self, low: Floats, high: Floats) -> float:
        """By how much the sum of squares would fall if slopes stayed as they are.

        A parameter at an end of its range, from `low` to `high`, does not go on.
        """
        if self.last is None:
            return math.inf
        inside = (self.last.x > low + _EDGE) & (self.last.x < high - _EDGE)
        basis, _ = np.linalg.qr(self.last.slopes[:, inside])
        return float(np.sum((basis.T @ self.last.residual) ** 2))

    def _corrected(self, x: Floats, here: Floats) -> Floats | None:
        """The last slopes with what the step to `x` tells; None if it was ill foretold."""
        if self.last is None:
            return None
        step, change = x - self.last.x, here - self.last.residual
        if float(change @ change) < _TOO_SMALL:
            return self.last.slopes
        missed = change - self.last.slopes @ step
        share = float(np.linalg.norm(missed) / np.linalg.norm(change))
        if share > _FORETOLD:
            return None
        weighed = step * np.sum(self.last.slopes**2, axis=0)
        self.corrected = True
        corrected: Floats = self.last.slopes + np.outer(missed, weighed / (weighed @ step))
        return corrected

    def _taken(self, x: Floats, here: Floats) -> Floats:
        """Forward differences, backward in the upper half of a range."""
        columns = np.empty((len(here), len(x)))
        for i, difference in enumerate(self._differences):
            step = -difference if x[i] > 0.5 else difference
            moved = x.copy()
            moved[i] += step
            columns[:, i] = (self._residual(moved) - here) / step
        return columns
