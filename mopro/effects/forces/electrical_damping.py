"""Damping by the drive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import WIDER, Domain, Effect, Parameter, Toleranced, View
from mopro.engine.candidate import Candidate
from mopro.machine import Machine
from mopro.machine.constants import PlantConstants


class ElectricalDamping(Effect):
    """The drive damps the relative speed by another ratio than the machine states.

    c_s = 2 zeta √(K m) with the bare mass; zeta is a ratio. Source: assumed.
    """

    name = "electrical_damping"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("zeta", "1", "ratio", 0.01, (0.002, 0.1), 0.0, 2.0, "damping ratio", null=0.03),
    )

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, damping_N_s_m=p[0] * plant.critical_N_s_m)

    def forms(self, view: View) -> Iterator[Candidate]:
        """Tried at half and twice what the machine has; a machine with much may have more."""
        ratio = view.machine.axis.damping_ratio
        own = self.fitted("zeta", *((ratio / 2, 2 * ratio) if ratio else (0.01, 0.05)))
        low, high = own.plausible or (own.low, own.high)
        zeta = replace(
            own, low=0.0, high=max(own.high, 2 * WIDER * ratio), null=ratio,
            plausible=(low, max(high, 2 * ratio)),
        )  # fmt: skip
        yield self.form(zeta)

    def toleranced(self, machine: Machine) -> Toleranced:
        ratio = machine.axis.damping_ratio
        # The plant has c_s, which the file's ratio makes with its force: c_s ~ zeta √F0.
        return Toleranced("axis.damping_ratio", ratio, ratio, ("axis.pull_out_force",))
