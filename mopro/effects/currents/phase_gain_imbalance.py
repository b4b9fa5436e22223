"""Two phases of different gain."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class PhaseGainImbalance(Effect):
    """The two phases' gains differ.

    i_a' = i_a (1 + eps/2), i_b' = i_b (1 - eps/2); eps is a ratio. At low speed
    Δx = -eps/(2k) sin 2θ. Source: assumed.
    """

    name = "phase_gain_imbalance"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (
        Parameter("eps", "1", "ratio", 0.04, (-0.1, 0.1), -1.0, 1.0, "relative difference"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, eps: float) -> tuple[float, float]:
        return ia * (1.0 + eps / 2.0), ib * (1.0 - eps / 2.0)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("eps", 0.03))
