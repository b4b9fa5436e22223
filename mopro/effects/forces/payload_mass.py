"""Payload that is not stated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.machine.constants import PlantConstants

# Masses that are tried are so many times apart.
_HEAVIER = 1.12


class PayloadMass(Effect):
    """The forcer carries more mass than stated.

    m' = m + dm, in kg. Source: chapter 4.3.2, moves with 5 lb.
    """

    name = "payload_mass"
    domain = Domain.DYNAMICS
    parameters = (Parameter("dm", "kg", "mass", 1.0, (0.0, 3.0), -2.0, 50.0, "added mass"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, mass_kg=plant.mass_kg + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        mass_kg = view.machine.axis.moving_mass_kg
        yield self.form(self.fitted("dm", 0.02, *self._heavier(mass_kg)))

    def _heavier(self, mass_kg: float) -> Iterator[float]:
        """Payloads to try beside a mass, to the end of the plausible range.

        A ring's frequency goes with both masses and forces: a signature taken too far off is out
        of phase with what it is to show.
        """
        _, most = self.parameter("dm").plausible
        total_kg = _HEAVIER * mass_kg
        while total_kg < mass_kg + most:
            yield total_kg - mass_kg
            total_kg *= _HEAVIER
        yield most
