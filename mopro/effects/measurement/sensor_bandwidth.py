"""A sensor that follows slowly."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.engine.candidate import Parameter as Fitted
from mopro.instruments.quantity import Quantity

_CORNER = Fitted(
    "f_c", "Hz", 33.0, 1e7, (150.0, 500.0), plausible=(50.0, 2e4), inverse=True, null=math.inf
)


class SensorBandwidth(Effect):
    """The sensor follows with a first-order lag.

    x' + (1/(2π f_c)) dx'/dt = x, f_c in Hz. Source: carrier filters of DC-LVDTs;
    figures assumed.
    """

    name = "sensor_bandwidth"
    domain = Domain.MEASUREMENT
    families = ("delay",)
    parameters = (
        Parameter("f_c", "Hz", "frequency", 200.0, (50.0, 1000.0), 0.01, 1e9, "corner", null=1e9),
    )

    def bandwidth_s(self, quantity: Quantity, *p: float) -> float:
        return 1 / (2 * math.pi * p[0]) if quantity.sees_place else 0.0

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(_CORNER)
