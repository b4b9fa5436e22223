"""Lag of a thermocouple."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.instruments.quantity import Quantity


class ThermocoupleLag(Effect):
    """The thermocouple follows the forcer's surface with a first-order lag.

    T_m + tau dT_m/dt = T, tau in s. Source: tape-mounted junction of chapter 3.2.1;
    figures assumed.
    """

    name = "thermocouple_lag"
    domain = Domain.HEAT
    parameters = (Parameter("tau", "s", "time", 15.0, (2.0, 60.0), 0.0, 3600.0, "time constant"),)

    def bandwidth_s(self, quantity: Quantity, *p: float) -> float:
        return p[0] if quantity.slow else 0.0

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("tau", 10.0))
