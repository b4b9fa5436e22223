"""Jacobian of a residual that costs a simulation: finite differences, then secant updates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from mopro.engine.assumed import FIT_TOLERANCE, INTERIOR, LINEARITY_ERROR, PROPORTIONAL, ROUNDING
from mopro.engine.series import Floats, Mask


def gauss_newton_step(jacobian: Floats, residual: Floats) -> Floats:
    """The step of the parameters that minimises |residual + jacobian @ step|² (samples x them).

    By the triangle of both, which costs half of what the samples do in `lstsq`.
    """
    scale = _norms(jacobian)
    # LAPACK factorises columns that are contiguous.
    both = np.empty((len(residual), len(scale) + 1), order="F")
    both[:, :-1], both[:, -1] = jacobian / scale, residual
    triangle: Floats = np.asarray(np.linalg.qr(both, mode="r"))
    step: Floats = np.linalg.lstsq(triangle[:, :-1], -triangle[:, -1], rcond=ROUNDING)[0] / scale
    return step


def bounded_step(jacobian: Floats, residual: Floats, room: Floats) -> Floats:
    """The Gauss-Newton step, or the best one within `room` where that leaves it.

    `room`: the least and the greatest step (2 x parameters) of each parameter, infinite where
    there is none. Bounded-variable least squares (Stark and Parker 1995), by SciPy.
    """
    step = gauss_newton_step(jacobian, residual)
    if ((room[0] <= step) & (step <= room[1])).all():
        return step
    # Rounding may have left a parameter just outside of its range.
    ends = np.array([np.minimum(room[0], 0.0), np.maximum(room[1], 0.0)])
    scale = _norms(jacobian)
    basis, triangle = np.linalg.qr(jacobian / scale)
    bounded = optimize.lsq_linear(triangle, -basis.T @ residual, ends * scale, method="bvls")
    inside: Floats = bounded.x / scale
    return inside


def _norms(jacobian: Floats) -> Floats:
    """Length of each column (samples x parameters), 1 for one of zeros."""
    norms: Floats = np.linalg.norm(jacobian, axis=0)
    norms[norms == 0] = 1.0
    return norms


@dataclass
class Iterate:
    """Point of a descent: scaled parameters `x`, residual and Jacobian there."""

    x: Floats
    residual: Floats
    jacobian: Floats


class SecantJacobian:
    """Jacobian (samples x parameters) of `residual`, asked for along the path of a fit.

    `differences` are the steps of finite differences, one for each parameter, and `parts` the
    samples that it changes, None for all. `change(x, moved)` is that of the residual, which may
    be told by a model that costs less. Where the Jacobian predicted a step well, the next one
    is a secant update of it, which costs no evaluation (Broyden 1965; here the correction is shared
    out by what each parameter contributed to the predicted change); else it is taken by
    differences, one evaluation for parameters whose parts do not overlap (Curtis, Powell and Reid
    1974). `updated` is True if the last one is a secant update: good for a step, and not for the
    errors of the parameters.
    """

    def __init__(
        self,
        residual: Callable[[Floats], Floats],
        differences: Sequence[float],
        parts: Sequence[Mask | None] = (),
        change: Callable[[Floats, Floats], Floats] | None = None,
    ) -> None:
        self._residual = residual
        self._change = change
        self._differences = differences
        self._parts = list(parts) or [None] * len(differences)
        self._together = _apart(self._parts)
        self.last: Iterate | None = None
        self.updated = False
        self._missed = 0.0

    def forget(self) -> None:
        """Take the next Jacobian by finite differences."""
        self.last = None

    def at(self, x: Floats) -> Floats:
        residual = self._residual(x)
        jacobian = self._secant_update(x, residual)
        if jacobian is None:
            jacobian = self._finite_differences(x, residual)
            self.updated, self._missed = False, 0.0
        self.last = Iterate(x.copy(), residual, jacobian)
        return jacobian

    def linear_minimum(self, low: Floats, high: Floats) -> Floats:
        """Residual at the minimum of the problem that is linear as at the last Jacobian.

        A parameter at an end of its range, from `low` to `high`, stays there.
        """
        assert self.last is not None, "the Jacobian is taken at the start"
        inside = (self.last.x > low + INTERIOR) & (self.last.x < high - INTERIOR)
        own, residual = self.last.jacobian[:, inside], self.last.residual
        return residual + own @ gauss_newton_step(own, residual) if inside.any() else residual

    def _secant_update(self, x: Floats, residual: Floats) -> Floats | None:
        """The last Jacobian corrected by the step to `x`; None if it predicted that badly."""
        if self.last is None:
            return None
        step, change = x - self.last.x, residual - self.last.residual
        if float(change @ change) < FIT_TOLERANCE:
            return self.last.jacobian
        missed = change - self.last.jacobian @ step
        share = float(np.linalg.norm(missed) / np.linalg.norm(change))
        if share > 1 / PROPORTIONAL:
            return None
        weighted = step * np.sum(self.last.jacobian**2, axis=0)
        self._missed += share
        self.updated = self._missed > LINEARITY_ERROR
        updated: Floats = self.last.jacobian + np.outer(missed, weighted / (weighted @ step))
        return updated

    def _finite_differences(self, x: Floats, residual: Floats) -> Floats:
        """Forward differences, backward in the upper half of a range."""
        columns = np.zeros((len(residual), len(x)))
        for together in self._together:
            steps = {i: -d if x[i] > 0.5 else d for i in together for d in [self._differences[i]]}
            moved = x.copy()
            moved[together] += list(steps.values())
            if self._change is None:
                change = self._residual(moved) - residual
            else:
                change = self._change(x, moved)
            for i, step in steps.items():
                part = self._parts[i]
                own = slice(None) if part is None else part
                columns[own, i] = change[own] / step
        return columns


def _apart(parts: Sequence[Mask | None]) -> list[list[int]]:
    """Groups of parameters whose parts do not overlap, each of which is in one group."""
    groups: list[tuple[list[int], Mask | None]] = []
    for i, part in enumerate(parts):
        for place, (together, taken) in enumerate(groups):
            if part is not None and taken is not None and not (taken & part).any():
                groups[place] = [*together, i], taken | part
                break
        else:
            groups.append(([i], part))
    return [together for together, _ in groups]
