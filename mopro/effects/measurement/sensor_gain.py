"""A sensor of another gain."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate
from mopro.engine.tolerances import GAIN


class SensorGain(Effect):
    """The sensor's gain is off.

    x' = x (1 + g); g is a ratio. Source: appendix D; figures assumed.
    """

    name = "sensor_gain"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    of_sensor = GAIN
    parameters = (Parameter("g", "1", "ratio", 2e-3, (-0.01, 0.01), -0.5, 0.5, "excess"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("g", 1e-3))
