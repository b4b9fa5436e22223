"""Dry friction that is larger at rest than in motion."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.effects.base import Domain, Parameter, View
from mopro.effects.forces.coulomb_friction import CoulombFriction
from mopro.effects.forces.dahl import PRESLIDING, DahlFriction, with_presliding
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted

_SPEED_M_S = 0.05


class StribeckFriction(DahlFriction):
    """Dry friction that falls with the speed, from a static to a sliding value.

    F = -(Fc + (Fs - Fc) exp(-(ẋ/vs)²)) z with presliding after Dahl as in coulomb_friction;
    Fc and Fs in N, vs in m/s, delta in m. At Fs = Fc it is coulomb_friction. Source:
    R. Stribeck's curve in the form of B. Armstrong-Hélouvry; figures assumed.
    """

    name = "stribeck_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Fc", "N", "force", 3.0, (0.5, 10.0), 0.0, 100.0, "sliding friction"),
        PRESLIDING,
        Parameter("Fs", "N", "force", 6.0, (0.5, 15.0), 0.0, 100.0, "static friction"),
        Parameter(
            "vs", "m/s", "velocity", _SPEED_M_S, (0.005, 0.3), 1e-4, 10.0,
            "speed at which it falls", null=_SPEED_M_S,
        ),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, z: float, fc: float, delta: float, fs: float, vs: float) -> float:
        return -(fc + (fs - fc) * math.exp(-(v / vs) * (v / vs))) * z

    def forms(self, view: View) -> Iterator[Candidate]:
        """All three at once: with fewer free it is hardly more than a Coulomb friction."""
        speed = Fitted(
            "vs",
            "m/s",
            2e-3,
            0.6,
            (0.02, 0.1),
            Role.SHAPE,
            plausible=self.parameter("vs").plausible,
        )
        forces = self.fitted("Fc", 1.0, 3.0), self.fitted("Fs", 2.0, 6.0)
        plain = self.form(*forces, speed, special=CoulombFriction.name)
        yield from with_presliding(plain)
