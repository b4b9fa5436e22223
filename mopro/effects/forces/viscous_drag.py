"""Drag in proportion to the speed."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class ViscousDrag(Effect):
    """Drag in proportion to the speed, of the air film or the umbilical.

    F = -b ẋ, b in N s/m. Source: chapter 2.1, "nearly frictionless"; figures assumed.
    """

    name = "viscous_drag"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    families = ("delay",)
    parameters = (Parameter("b", "N s/m", "drag", 5.0, (0.5, 15.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, b: float) -> float:
        return -b * v

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("b", 3.0))
