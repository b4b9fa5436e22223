"""The way down to a least sum of squares, with as few simulations as that takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from scipy import optimize

from mopro.diagnosis.model import Floats
from mopro.diagnosis.slopes import Place, Slopes

_MOST_EVALUATIONS = 15
# Rounds after the first start from slopes taken anew, which are also what errors come from.
_MOST_ROUNDS = 3
# Where a residual has a kink, steps are cut to a quarter again and again.
_MOST_CUTS = 4


class _Arrived(Exception):
    """Nothing is to be gained by another step."""


class Descent:
    """Least squares of `residual` over a box, by SciPy's trust regions.

    Parameters are shares of their ranges, residuals in standard deviations. `differences`
    are what the slopes are taken with. A descent that is out of reach of a sum of squares of
    `limit` is given up as `hopeless`.
    """

    def __init__(
        self, residual: Callable[[Floats], Floats], differences: Sequence[float], limit: float
    ) -> None:
        self._residual = residual
        self._slopes = Slopes(residual, differences)
        self._limit = limit
        self._last_rss = math.inf
        self._cuts = 0
        self.hopeless = False

    def run(self, start: Floats, low: Floats, high: Floats, tolerance: float) -> Place:
        """The lowest place found from `start`; `tolerance` is relative to the sum of squares."""
        x = np.clip(start, low + 1e-6, high - 1e-6)
        for _ in range(_MOST_ROUNDS):
            place = self._round(x, low, high, tolerance)
            if self.hopeless or not self._slopes.corrected:
                break
            self._slopes.forget()
            x = place.x
        return place

    def _round(self, x: Floats, low: Floats, high: Floats, tolerance: float) -> Place:
        def stepped(x: Floats) -> Floats:
            if self._slopes.last is not None and self._arrived(x, tolerance):
                raise _Arrived
            return self._residual(x)

        def slopes(x: Floats) -> Floats:
            self._cuts = 0
            return self._slopes.at(x)

        def given_up(intermediate_result: optimize.OptimizeResult) -> None:
            if self._out_of_reach(2 * float(intermediate_result.cost), low, high):
                self.hopeless = True
                raise StopIteration

        with suppress(_Arrived):
            optimize.least_squares(
                stepped, x, jac=slopes, method="dogbox", bounds=(low, high), xtol=1e-9,
                gtol=1e-12, x_scale="jac", ftol=tolerance, max_nfev=_MOST_EVALUATIONS,
                callback=given_up,
            )  # fmt: skip
        assert self._slopes.last is not None, "slopes are taken at the start"
        return self._slopes.last

    def _arrived(self, x: Floats, tolerance: float) -> bool:
        """Whether the slopes promise next to nothing of a step to `x`, or all too often did."""
        last = self._slopes.last
        assert last is not None, "asked after the start only"
        self._cuts += 1
        change = last.slopes @ (x - last.x)
        gain = -float(change @ (2 * last.residual + change))
        return self._cuts > _MOST_CUTS or gain < tolerance * float(last.residual @ last.residual)

    def _out_of_reach(self, rss: float, low: Floats, high: Floats) -> bool:
        """Whether neither steps nor slopes lead to the limit.

        All further steps, each as good as the last, would not; and slopes do not promise
        half as much. (A step may be short because the way bends.)
        """
        gained, self._last_rss = self._last_rss - rss, rss
        missing = rss - self._limit
        slow = gained * _MOST_EVALUATIONS < missing
        return slow and 2 * self._slopes.promise(low, high) < missing
