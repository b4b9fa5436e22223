"""Dry friction that the motor's own force presses on."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Parameter, View
from mopro.effects.forces.dahl import PRESLIDING, DahlFriction, with_presliding
from mopro.engine.candidate import Candidate


class LoadDependentFriction(DahlFriction):
    """Dry friction in proportion to the motor's force, as of a guide that it is pressed against.

    F = -mu |F_motor| z with presliding after Dahl as in coulomb_friction; mu is a ratio,
    delta in m. While it accelerates at a, the motor gives m a / (1 - mu); while it brakes,
    m a / (1 + mu). Source: assumed.
    """

    name = "load_dependent_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("mu", "1", "ratio", 0.1, (0.01, 0.3), 0.0, 0.9, "friction over motor force"),
        PRESLIDING,
    )

    @staticmethod
    def reaction(x: float, v: float, z: float, motor_N: float, mu: float, delta: float) -> float:
        return -mu * abs(motor_N) * z

    def forms(self, view: View) -> Iterator[Candidate]:
        yield from with_presliding(self.form(self.fitted("mu", 0.03, 0.15)))
