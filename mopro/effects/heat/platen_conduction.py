"""Heat that flows into the platen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mopro.diagnosis.model import Candidate, Role
from mopro.diagnosis.model import Parameter as Fitted
from mopro.effects.base import Domain, Effect, Parameter, Surroundings, View


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

    def forms(self, view: View) -> Iterator[Candidate]:
        """Its forms with the platen's temperature free, as nobody measured it.

        A machine file that states it is believed.
        """
        stated = "T_p" in view.own(self.name)
        low, high = self.parameter("T_p").plausible
        platen = Fitted(
            "T_p", "C", low, high, (view.machine.heat.ambient_C,), Role.CONSTANT,
            plausible=(low, high),
        )  # fmt: skip
        for form in super().forms(view):
            fixed = {name: value for name, value in form.fixed.items() if name != "T_p"}
            freed = replace(form, parameters=(*form.parameters, platen), fixed=fixed)
            yield form if stated else freed
