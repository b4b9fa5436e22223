"""A controller that goes at another speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.diagnosis.model import Candidate
from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.effects.command.scaled import scaled
from mopro.program import Program, ir


class VelocityScale(Effect):
    """The controller's velocity differs from the one that the program sets.

    v' = v (1 + e); e is a ratio. Distances stay, durations follow. Source: chapter 4.3,
    "the actual peak velocity is higher than the theoretical".
    """

    name = "velocity_scale"
    domain = Domain.COMMAND
    parameters = (Parameter("e", "1", "ratio", 0.01, (-0.02, 0.02), -0.5, 1.0, "relative excess"),)

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(
            replace(op, velocity_uu_s=scaled(op.velocity_uu_s, p[0]))
            if isinstance(op, ir.SetVelocity)
            else op
            for op in program.ops
        )
        return replace(program, ops=ops)

    def fastest(self) -> tuple[float, ...]:
        return (self.parameter("e").plausible[1],)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 1e-3, -0.01, 0.015))
