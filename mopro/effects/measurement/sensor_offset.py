"""A sensor whose zero is off."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate


class SensorOffset(Effect):
    """The sensor's zero is off.

    x' = x + o, in m. Source: assumed.
    """

    name = "sensor_offset"
    domain = Domain.MEASUREMENT
    reservation = "an offset belongs to the sensor's zero"
    constant_offset = "o"
    parameters = (Parameter("o", "m", "length", 1e-4, (-1e-3, 1e-3), -1.0, 1.0, "offset"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0]

    def forms(self, view: View) -> Iterator[Candidate]:
        """None: an offset of each run is fitted always."""
        yield from ()
