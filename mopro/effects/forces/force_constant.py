"""Force constant of the motor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Parameter, Toleranced, View
from mopro.engine.candidate import Candidate
from mopro.machine import Machine
from mopro.machine.constants import PlantConstants


class ForceConstant(Effect):
    """The motor is stronger or weaker than the machine states.

    F0' = F0 (1 + e); e is a ratio. c_s stays: it is a constant of the drive. Source: F0
    itself is assumed.
    """

    name = "force_constant"
    domain = Domain.DYNAMICS
    parameters = (Parameter("e", "1", "ratio", 0.1, (-0.2, 0.2), -0.95, 5.0, "relative excess"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, pull_out_force_N=plant.pull_out_force_N * (1 + p[0]))

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 0.003, -0.05, 0.09, -0.11, -0.17, 0.17))

    def toleranced(self, machine: Machine) -> Toleranced:
        return Toleranced("axis.pull_out_force", 0.0, 1.0)
