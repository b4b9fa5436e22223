"""Terms missing in the heat balance of chapter 3.1."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mopro.effects.effect import Domain, Effect, Parameter, Surroundings, View
from mopro.engine.candidate import Candidate
from mopro.instruments.quantity import Quantity


class AmbientDrift(Effect):
    """The room warms or cools during the run.

    T_air' = T_air + r t, r in K/s. Source: the experiments took four weeks (chapter
    3.2.2); figures assumed.
    """

    name = "ambient_drift"
    domain = Domain.HEAT
    of_one_run = True
    parameters = (
        Parameter("r", "K/s", "temperature rate", 2.8e-4, (-5.6e-4, 5.6e-4), -0.1, 0.1, "rate"),
    )

    def heat(self, here: Surroundings, *p: float) -> None:
        here.air_C += p[0] * here.time_s

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("r", 1e-4))


class PlatenConduction(Effect):
    """Heat flows through the air gap into the platen.

    P' = P - (G + g s)(T - T_p): G in W/K, g in W/(m K) with s the length of the path, as in
    the Reynolds number (the swept strip grows with it), T_p in °C. Source: chapter 3.4,
    "it should consider heat loss by conduction".
    """

    name = "platen_conduction"
    domain = Domain.HEAT
    parameters = (
        Parameter("G", "W/K", "thermal conductance", 4.0, (1.0, 40.0), 0.0, 500.0, "at rest"),
        Parameter(
            "g", "W/(m K)", "thermal conductivity", 0.0, (0.0, 40.0), 0.0, 500.0,
            "more of it per metre of path",
        ),
        Parameter("T_p", "C", "temperature", 24.87, (15, 40), -50, 150, "platen", null=24.87),
    )  # fmt: skip

    def heat(self, here: Surroundings, *p: float) -> None:
        conductance = p[0] + p[1] * math.hypot(*here.lengths_m)
        here.extra_W -= conductance * (here.temperature_C - p[2])


class SpeedDependentHeat(Effect):
    """Core losses grow with the step frequency.

    P' = P + Σ over moving axes of (kh f + ke f²), f = v/pitch; kh in W/Hz, ke in W/Hz².
    Source: chapter 3.4, "dependence of the heat generated on the velocity".
    """

    name = "speed_dependent_heat"
    domain = Domain.HEAT
    parameters = (
        Parameter("kh", "W/Hz", "energy per cycle", 0.05, (0.0, 0.2), 0.0, 10.0, "hysteresis"),
        Parameter("ke", "W/Hz2", "eddy loss", 0.0, (0.0, 2e-4), 0.0, 0.1, "eddy currents"),
    )

    def heat(self, here: Surroundings, *p: float) -> None:
        for speed in here.speeds_m_s:
            f = speed / here.machine.axis.pitch_m
            here.extra_W += p[0] * f + p[1] * f * f


class ConvectionScale(Effect):
    """The heat transfer to the air differs from the flat-plate formula.

    h' = h (1 + e); e is a ratio. Source: chapter 3.3, "the model may have underestimated
    the forced convection".
    """

    name = "convection_scale"
    domain = Domain.HEAT
    parameters = (Parameter("e", "1", "ratio", 0.5, (-0.5, 3.0), -0.95, 20.0, "excess"),)

    def heat(self, here: Surroundings, *p: float) -> None:
        here.conductance_W_K *= 1 + p[0]


_COPPER_1_K = 0.00393


class ResistanceTempco(Effect):
    """Copper's resistance grows as it warms, at constant current.

    R' = R (1 + alpha (T - T0)), alpha = 0.00393 1/K for copper, T0 in °C. Source:
    handbook value.
    """

    name = "resistance_tempco"
    domain = Domain.HEAT
    parameters = (
        Parameter(
            "alpha", "1/K", "expansion", _COPPER_1_K, (_COPPER_1_K, _COPPER_1_K), 0.0, 0.01,
            "temperature coefficient",
        ),
        Parameter("T0", "C", "temperature", 24.87, (15, 30), -50, 150, "where R holds", null=24.87),
    )  # fmt: skip

    def heat(self, here: Surroundings, *p: float) -> None:
        here.coil_W *= 1 + p[0] * (here.temperature_C - p[1])


_STEFAN_BOLTZMANN = 5.670374419e-8
_KELVIN = 273.15


class Radiation(Effect):
    """The forcer radiates heat.

    P' = P - eps σ A (T⁴ - Ta⁴) in kelvins, A its sides and top; eps is a ratio. Source:
    Stefan and Boltzmann's law.
    """

    name = "radiation"
    domain = Domain.HEAT
    parameters = (Parameter("eps", "1", "ratio", 0.3, (0.02, 0.95), 0.0, 1.0, "emissivity"),)

    def heat(self, here: Surroundings, *p: float) -> None:
        area = here.machine.heat.side_area_m2 + here.machine.heat.top_area_m2
        hot, cold = here.temperature_C + _KELVIN, here.air_C + _KELVIN
        here.extra_W -= p[0] * _STEFAN_BOLTZMANN * area * (hot**4 - cold**4)


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
