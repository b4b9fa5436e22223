"""Heat that flows into the platen."""

from __future__ import annotations

import math

from mopro.effects.base import Domain, Effect, Parameter, Surroundings


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
