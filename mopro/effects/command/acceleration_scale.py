"""A controller that accelerates at another rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.diagnosis.model import Candidate
from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.effects.command.scaled import scaled
from mopro.program import Program, ir


class AccelerationScale(Effect):
    """The controller's acceleration differs from the one that the program sets.

    a' = a (1 + e); e is a ratio. Distances stay, durations follow. Source: PHYSICS.md,
    assumed; Table 4.5 gives accelerations in round numbers only.
    """

    name = "acceleration_scale"
    domain = Domain.COMMAND
    parameters = (Parameter("e", "1", "ratio", 0.05, (-0.5, 0.5), -0.9, 4.0, "relative excess"),)

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(
            replace(op, acceleration_uu_s2=scaled(op.acceleration_uu_s2, p[0]))
            if isinstance(op, ir.SetAcceleration)
            else op
            for op in program.ops
        )
        return replace(program, ops=ops)

    def fastest(self) -> tuple[float, ...]:
        return (self.parameter("e").plausible[1],)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 0.02, -0.1, 0.1, -0.35, 0.4))
