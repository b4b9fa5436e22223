"""Coulomb friction."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Parameter, View
from mopro.effects.forces.dahl import PRESLIDING, DahlFriction, with_presliding
from mopro.engine.candidate import Candidate

# Forces (N) that it is probed at: a dry friction is far from proportional to its force.
PROBED_N = (1.0, 3.0, 9.0)


class CoulombFriction(DahlFriction):
    """Dry friction with presliding after Dahl.

    F = -Fc z, dz/dx = (1 - z sgn ẋ) / delta; Fc in N, delta in m. z depends on the path
    alone, z = s - (s - z0) exp(-|Δx|/delta) with s the direction, and is taken so at
    every stage of the integrator. Source: P. R. Dahl's model; figures assumed.
    """

    name = "coulomb_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Fc", "N", "force", 3.0, (0.5, 10.0), 0.0, 100.0, "sliding friction"),
        PRESLIDING,
    )

    @staticmethod
    def force(x: float, v: float, z: float, fc: float, delta: float) -> float:
        return -fc * z

    def forms(self, view: View) -> Iterator[Candidate]:
        yield from with_presliding(self.form(self.fitted("Fc", *PROBED_N)))
