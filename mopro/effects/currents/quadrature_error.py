"""Two phases that are not a quarter turn apart."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class QuadratureError(Effect):
    """The phases are not a quarter turn apart.

    i_b' = sin(θ + phi), phi in rad. At low speed Δx = phi/(2k) (1 + cos 2θ) for small
    phi. Source: assumed.
    """

    name = "quadrature_error"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (Parameter("phi", "rad", "angle", 0.035, (-0.0873, 0.0873), -1.0, 1.0, "angle"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, phi: float) -> tuple[float, float]:
        # As sin(θ + phi) - sin θ: only what does not change in a run is a sine of another angle.
        half = math.sin(0.5 * phi)
        more = math.cos(theta) * math.sin(phi) - 2.0 * half * half * math.sin(theta)
        return ia, ib + more

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("phi", 0.02))
