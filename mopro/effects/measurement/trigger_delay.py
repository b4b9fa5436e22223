"""Data that begin late."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, View
from mopro.engine.candidate import Candidate


class TriggerDelay(Effect):
    """The data begin late against the program's clock.

    x'(t) = x(t - t_d), t_d in s. Source: assumed.
    """

    name = "trigger_delay"
    domain = Domain.MEASUREMENT
    families = ("delay",)
    parameters = (Parameter("t_d", "s", "time", 2e-3, (0.0, 0.01), -1.0, 1.0, "delay"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s - p[0]

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("t_d", 1e-3))
