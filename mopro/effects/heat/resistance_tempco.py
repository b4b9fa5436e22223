"""Resistance of the coils against temperature."""

from __future__ import annotations

from mopro.effects.base import Domain, Effect, Parameter, Surroundings

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
