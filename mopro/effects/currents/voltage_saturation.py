"""A drive limited by its supply voltage."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.machine import Machine

_SUPPLY = Fitted(
    "Vb", "V", 25.0, 225.0, (40.0, 50.0, 90.0), Role.SHAPE, plausible=(40.0, 150.0), inverse=True
)


class VoltageSaturation(Effect):
    """The supply voltage limits the phase currents: the full electrical model of each phase.

    v_a = R i_a + L di_a/dt - Kf ẋ sin kx, v_b = R i_b + L di_b/dt + Kf ẋ cos kx, with
    Kf = F0/I and |v| <= Vb (V). The current loop asks for what keeps the current on its
    setpoint, and brings it back within 50 µs, as long as Vb suffices. Source: R is eq.
    3.45; L and supply are assumed.
    """

    name = "voltage_saturation"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Vb", "V", "voltage", 75.0, (40.0, 150.0), 1.0, 1e6, "supply", null=1e6),
    )
    current_loop = "voltage"

    def stated_by(self, machine: Machine) -> tuple[float, ...] | None:
        """A drive of the full electrical model has it at its supply."""
        return (machine.drive.supply_V,) if machine.drive.model == "full" else None

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(_SUPPLY)
