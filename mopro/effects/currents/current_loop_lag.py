"""A drive whose currents lag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate

# A shorter lag is a mere delay.
_SHORTEST_S = 1e-5


class CurrentLoopLag(Effect):
    """Each phase current follows its setpoint with a first-order lag.

    tau di/dt = i_set - i, tau in s. At a steady speed ω = k ẋ: amplitude
    1/√(1 + ω² tau²) and angle atan(ω tau), so Δx = -atan(ω tau)/k. Source: assumed.
    """

    name = "current_loop_lag"
    domain = Domain.DYNAMICS
    families = ("delay",)
    parameters = (Parameter("tau", "s", "time", 1e-4, (2e-5, 5e-4), 0.0, 0.01, "time constant"),)
    current_loop = "lag"

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(replace(self.fitted("tau", 5e-5, 3e-4), low=_SHORTEST_S))
