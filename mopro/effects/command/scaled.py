"""A number that programs set, taken by the controller as an exact multiple."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any, ClassVar

from mopro.effects.base import Domain, Effect
from mopro.program import Program, ir


class ScaledSetting(Effect):
    """Base of effects whose parameter e (a ratio) makes a setting s of programs s (1 + e).

    `operation` is the operation that sets it, `setting` the field that holds it.
    """

    domain = Domain.COMMAND
    operation: ClassVar[type[ir.Op]]
    setting: ClassVar[str]

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(self._scaled(op, p[0]) for op in program.ops)
        return replace(program, ops=ops)

    def _scaled(self, op: ir.Op, e: float) -> ir.Op:
        if not isinstance(op, self.operation):
            return op
        changed: dict[str, Any] = {self.setting: getattr(op, self.setting) * (1 + Fraction(e))}
        return replace(op, **changed)

    def fastest(self) -> tuple[float, ...]:
        return (self.parameter("e").plausible[1],)
