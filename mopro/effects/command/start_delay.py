"""Motion that starts late."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.program import Program, ir

_MS_PER_S = 1000


class StartDelay(Effect):
    """Motion starts later than commanded.

    x_c'(t) = x_c(t - d), d in s, once at the start of the program; with `every_move` = 1
    each move is late by d, which adds up where the program waits for motions to end.
    Source: assumed.
    """

    name = "start_delay"
    domain = Domain.COMMAND
    families = ("delay",)
    parameters = (
        Parameter("d", "s", "time", 5e-3, (0.0, 0.02), 0.0, 10.0, "delay"),
        Parameter(
            "every_move", "1", "ratio", 0.0, (0, 1), 0.0, 1.0,
            "0: once, 1: before each move", whole=True,
        ),
    )  # fmt: skip

    def program(self, program: Program, *p: float) -> Program:
        milliseconds = Fraction(p[0]) * _MS_PER_S
        if not p[1]:
            return replace(program, ops=(ir.Dwell(program.ops[0].span, milliseconds), *program.ops))
        ops: list[ir.Op] = []
        for op in program.ops:
            if op.seeks_switch or isinstance(op, ir.Move | ir.Go):
                ops.append(ir.Dwell(op.span, milliseconds))
            ops.append(op)
        return replace(program, ops=tuple(ops))

    def forms(self, view: View) -> Iterator[Candidate]:
        delay = self.fitted("d", 1e-3, 8e-3)
        yield self.form(delay, form="once", fixed={"every_move": 0.0})
        yield self.form(delay, form="each move", fixed={"every_move": 1.0})
