"""A constant force."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.machine import Machine


class ConstantForce(Effect):
    """A constant force, such as a tilted platen's.

    F = F_b, in N. Source: assumed.
    """

    name = "constant_force"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (Parameter("F_b", "N", "force", 1.0, (-5.0, 5.0), -100.0, 100.0, "force"),)

    @staticmethod
    def force(x: float, v: float, f_b: float) -> float:
        return f_b

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("F_b", 1.0))

    def static_deflection_m(self, machine: Machine) -> float:
        """F/K."""
        most_N = max(map(abs, self.parameter("F_b").plausible))
        return most_N / machine.axis.stiffness_N_m
