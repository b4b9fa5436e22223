"""Error of the convection formula."""

from __future__ import annotations

from mopro.effects.base import Domain, Effect, Parameter, Surroundings


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
