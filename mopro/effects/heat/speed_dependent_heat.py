"""Core losses."""

from __future__ import annotations

from mopro.effects.base import Domain, Effect, Parameter, Surroundings


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
