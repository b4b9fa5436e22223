"""A sensor whose coupling has play."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate
from mopro.engine.play import follow


class Backlash(Effect):
    """The sensor's coupling has play.

    x' = x - B/2 sgn(direction of the last motion), B in m: after a reversal the axis
    crosses the play before the sensor follows; it starts in the middle. Source: assumed.
    """

    name = "backlash"
    domain = Domain.MEASUREMENT
    parameters = (Parameter("B", "m", "length", 2e-5, (1e-6, 1e-4), 0.0, 0.01, "reversal step"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return follow(x, p[0] / 2)

    def forms(self, view: View) -> Iterator[Candidate]:
        # The response is not smooth: fewer oscillations cross a larger play.
        yield self.form(replace(self.fitted("B", 3e-6, 3e-5), difference=1e-5))
