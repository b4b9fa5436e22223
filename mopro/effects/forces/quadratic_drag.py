"""Drag in proportion to the square of the speed."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class QuadraticDrag(Effect):
    """Drag in proportion to the square of the speed.

    F = -c ẋ |ẋ|, c in N s²/m². Source: assumed.
    """

    name = "quadratic_drag"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (Parameter("c", "N s2/m2", "quadratic drag", 3.0, (0.5, 8.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return -c * v * abs(v)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("c", 1.5))
