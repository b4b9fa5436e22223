"""Thermal radiation."""

from __future__ import annotations

from mopro.effects.base import Domain, Effect, Parameter, Surroundings

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
