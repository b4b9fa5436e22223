"""A controller that goes at another speed."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Parameter, View
from mopro.effects.command.scaled import ScaledSetting
from mopro.engine.candidate import Candidate
from mopro.program import ir


class VelocityScale(ScaledSetting):
    """The controller's velocity differs from the one that the program sets.

    v' = v (1 + e); e is a ratio. Distances stay, durations follow. Source: chapter 4.3,
    "the actual peak velocity is higher than the theoretical".
    """

    name = "velocity_scale"
    operation = ir.SetVelocity
    setting = "velocity_uu_s"
    parameters = (Parameter("e", "1", "ratio", 0.01, (-0.02, 0.02), -0.5, 1.0, "relative excess"),)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 1e-3, -0.01, 0.015))
