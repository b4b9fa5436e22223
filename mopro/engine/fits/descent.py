"""Least squares over a box with few evaluations of the residual."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from scipy import optimize

from mopro.engine.assumed import INTERIOR, ITERATIONS, LEAST_SHARE, MOST_CONDITION, REPEATS
from mopro.engine.fits.jacobian import Iterate, SecantJacobian
from mopro.engine.fits.limit import NO_LIMIT, Limit
from mopro.engine.series import Floats, Mask

# Length that the start adds to each column of the Jacobian, as a share of it: its square is a tenth
# of the least weight with which the data tell anything.
_HELD = math.sqrt(LEAST_SHARE / MOST_CONDITION)


class _Converged(Exception):
    """No further step lowers the sum of squares by as much as the tolerance."""


class Descent:
    """Minimises |residual(x)|² over a box, by SciPy's trust regions (`dogbox`).

    Parameters `x` are shares of their ranges, residuals are in standard deviations.
    `differences`: steps of finite differences in `x`. A descent that cannot come down to
    `limit` is `abandoned`. `parts`: the samples that each parameter changes.
    `change(x, moved)`: that of the residual; by the residual itself unless given.
    """

    def __init__(
        self,
        residual: Callable[[Floats], Floats],
        differences: Sequence[float],
        limit: Limit = NO_LIMIT,
        parts: Sequence[Mask | None] = (),
        change: Callable[[Floats, Floats], Floats] | None = None,
    ) -> None:
        self._residual = residual
        self._jacobian = SecantJacobian(residual, differences, parts, change)
        self._limit = limit
        self._last_missed = math.inf
        self._cuts = 0
        self.abandoned = False

    def run(self, start: Floats, low: Floats, high: Floats, tolerance: float) -> Iterate:
        """The minimum found from `start`; `tolerance` is relative to the sum of squares."""
        x = np.clip(start, low + INTERIOR, high - INTERIOR)
        for _ in range(REPEATS):
            reached = self._round(x, low, high, tolerance)
            # The last Jacobian is that of where the round ended.
            self.abandoned |= self._leads_nowhere(self._limit.missed(reached.residual), low, high)
            if self.abandoned or not self._jacobian.updated:
                break
            self._jacobian.forget()
            x = reached.x
        return reached

    def _round(self, x: Floats, low: Floats, high: Floats, tolerance: float) -> Iterate:
        # Along a direction that the data do not tell, a step of rounding alone would leave the
        # region in which it is trusted, and cut short what the data tell. There `x` stays.
        held, begun = np.zeros(len(x)), x

        def residual(x: Floats) -> Floats:
            if self._jacobian.last is not None and self._converged(x, tolerance):
                raise _Converged
            return np.concatenate([self._residual(x), held * (x - begun)])

        def jacobian(x: Floats) -> Floats:
            self._cuts = 0
            own = self._jacobian.at(x)
            if not held.any():
                held[:] = _HELD * np.linalg.norm(own, axis=0)
            return np.concatenate([own, np.diag(held)])

        def abandon(intermediate_result: optimize.OptimizeResult) -> None:
            if self._out_of_reach(intermediate_result.fun[: -len(held)], low, high):
                self.abandoned = True
                raise StopIteration

        with suppress(_Converged):
            optimize.least_squares(
                residual, x, jac=jacobian, method="dogbox", bounds=(low, high), xtol=1e-9,
                gtol=1e-12, x_scale="jac", ftol=tolerance, max_nfev=ITERATIONS,
                callback=abandon,
            )  # fmt: skip
        assert self._jacobian.last is not None, "the Jacobian is taken at the start"
        return self._jacobian.last

    def _converged(self, x: Floats, tolerance: float) -> bool:
        """True if the step to `x` is predicted to gain less than `tolerance`, or was cut enough."""
        last = self._jacobian.last
        assert last is not None, "asked after the start only"
        self._cuts += 1
        change = last.jacobian @ (x - last.x)
        decrease = -float(change @ (2 * last.residual + change))
        return self._cuts > REPEATS or decrease < tolerance * float(last.residual @ last.residual)

    def _out_of_reach(self, residual: Floats, low: Floats, high: Floats) -> bool:
        """True if neither steps nor slopes lead down to the limit.

        As many further steps as the budget allows, each as good as the last, do not. (A step may
        be short because the path bends.)
        """
        missed = self._limit.missed(residual)
        decrease, self._last_missed = self._last_missed - missed, missed
        return decrease * ITERATIONS < missed and self._leads_nowhere(missed, low, high)

    def _leads_nowhere(self, missed: float, low: Floats, high: Floats) -> bool:
        """True if twice the reduction that the slopes predict is less than what is `missed`."""
        if missed <= 0:
            return False
        predicted = self._limit.missed(self._jacobian.linear_minimum(low, high))
        return 2 * (missed - predicted) < missed
