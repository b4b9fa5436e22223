"""Third harmonic of the phase currents."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class CurrentThirdHarmonic(Effect):
    """The phase currents have a third harmonic.

    i_b' = i_b + s sin 3θ, and i_a' = i_a - s cos 3θ, the same shape a quarter turn
    earlier; s is a ratio. At low speed Δx = s/k sin 4θ. Source: assumed.
    """

    name = "current_third_harmonic"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (Parameter("s", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "over I"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, s: float) -> tuple[float, float]:
        # Of the angle's own sine and cosine, which compiled code has at hand.
        cosine, sine = math.cos(theta), math.sin(theta)
        cosine_3 = cosine * (4.0 * cosine * cosine - 3.0)
        return ia - s * cosine_3, ib + s * sine * (3.0 - 4.0 * sine * sine)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("s", 0.01))
