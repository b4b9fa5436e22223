"""Force constant against temperature."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, View
from mopro.engine.candidate import Candidate


class ForceConstantTemperature(Effect):
    """Magnets weaken as the forcer warms.

    F0' = F0 (1 - alpha (T - T0)); alpha in 1/K, T the forcer's temperature and T0 in °C.
    Source: magnet material data, 0.03 to 0.12 %/K.
    """

    name = "force_constant_temperature"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("alpha", "1/K", "expansion", 1e-3, (3e-4, 1.2e-3), 0.0, 8e-3, "loss per kelvin"),
        Parameter(
            "T0", "C", "temperature", 24.87, (15.0, 30.0), -50.0, 200.0,
            "where the machine's F0 holds", null=24.87,
        ),
    )  # fmt: skip

    def force_factor(self, temperature_C: Floats, *p: float) -> Floats:
        factor: Floats = 1 - p[0] * (temperature_C - p[1])
        return factor

    def forms(self, view: View) -> Iterator[Candidate]:
        """Magnets weaken from where F0 was measured on, which is assumed, not known."""
        fixed = {"T0": view.machine.heat.ambient_C}
        yield self.form(self.fitted("alpha", 5e-4), fixed=fixed)
