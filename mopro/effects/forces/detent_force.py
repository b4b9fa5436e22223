"""Detent force of the teeth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import WIDER, Domain, Effect, Parameter, View, phase
from mopro.engine.candidate import Candidate, Role

# Largest plausible detent force, as a share of the pull-out force.
_PLAUSIBLE_SHARE = 0.1


class DetentForce(Effect):
    """The teeth hold the forcer without current, four times a pitch.

    F = -Fd sin(4 k x + phi), k = 2π/pitch; Fd in N, phi in rad. Source: the four-step
    cycle of chapter 2.1; figures assumed.
    """

    name = "detent_force"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (
        Parameter("Fd", "N", "force", 5.0, (2.2, 11.0), 0.0, 100.0, "amplitude"),
        Parameter(
            "phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase", role=Role.PHASE
        ),
        Parameter(
            "pitch", "m", "length", 1.016e-3, (1.016e-3, 1.016e-3), 1e-5, 0.1,
            "the teeth's pitch", null=1.016e-3,
        ),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, fd: float, phi: float, pitch: float) -> float:
        return -fd * math.sin(8.0 * math.pi * x / pitch + phi)

    def forms(self, view: View) -> Iterator[Candidate]:
        """Shares of the pull-out force, small ones and large ones, as a ring bends under it.

        Where the teeth pass at their own frequency the answer is no mirror image half a turn on.
        """
        most = _PLAUSIBLE_SHARE * view.machine.axis.pull_out_force_N
        own = self.fitted("Fd", most / 4, 0.75 * most)
        highest = min(WIDER * most, self.parameter("Fd").high)
        force = replace(own, high=highest, plausible=(0.0, most))
        pitch = {"pitch": view.machine.axis.pitch_m}
        yield self.form(force, phase("phi", 0.0, math.pi), fixed=pitch)
