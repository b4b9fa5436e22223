"""A controller that accelerates at another rate."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Parameter, View
from mopro.effects.command.scaled import ScaledSetting
from mopro.engine.candidate import Candidate
from mopro.program import ir


class AccelerationScale(ScaledSetting):
    """The controller's acceleration differs from the one that the program sets.

    a' = a (1 + e); e is a ratio. Distances stay, durations follow. Source: assumed;
    Table 4.5 gives accelerations in round numbers only.
    """

    name = "acceleration_scale"
    operation = ir.SetAcceleration
    setting = "acceleration_uu_s2"
    parameters = (Parameter("e", "1", "ratio", 0.05, (-0.5, 0.5), -0.9, 4.0, "relative excess"),)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 0.02, -0.1, 0.1, -0.35, 0.4))
