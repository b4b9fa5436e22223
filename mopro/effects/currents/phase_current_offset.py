"""Offset of the phase currents."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate


class PhaseCurrentOffset(Effect):
    """The phase currents have an offset.

    i_a' = i_a + o_a, i_b' = i_b + o_b, in units of I. At low speed
    Δx = (o_b cos θ - o_a sin θ)/k. Source: assumed.
    """

    name = "phase_current_offset"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (
        Parameter("o_a", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "of phase a over I"),
        Parameter("o_b", "1", "ratio", 0.0, (-0.05, 0.05), -1.0, 1.0, "of phase b over I"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, oa: float, ob: float) -> tuple[float, float]:
        return ia + oa, ib + ob

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("o_a", 0.01), self.fitted("o_b", 0.01))
