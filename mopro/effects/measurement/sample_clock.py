"""A sampling clock that is off."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.engine.tolerances import CLOCK


class SampleClock(Effect):
    """The sampling clock runs slow, so that samples are taken later than labelled.

    x'(t) = x(t (1 + e)); e is a ratio. Source: assumed.
    """

    name = "sample_clock"
    domain = Domain.MEASUREMENT
    families = ("clock",)
    of_sensor = CLOCK
    parameters = (Parameter("e", "1", "ratio", 5e-4, (-5e-3, 5e-3), -0.1, 0.1, "relative excess"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 3e-4))
