"""The settings of a program, velocity, acceleration and profile, and programs with other ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any

from mopro.program import ir
from mopro.units import MS_PER_S

# The statements' mnemonics.
SETTINGS: dict[str, type[ir.AxisOp]] = {
    kind.statement.mnemonic(): kind for kind in (ir.SetVelocity, ir.SetAcceleration, ir.SetProfile)
}
_NAME = re.compile(rf"({'|'.join(SETTINGS)})([0-9])(?:@([1-9][0-9]{{0,8}}))?")


@dataclass(frozen=True)
class Setting:
    """One setting of some axes, in all of its statements or in those of one line.

    Written as a statement without its value: `VEL1`, `PARA0` (all axes), `ACC2@14` (line 14).
    """

    kind: type[ir.AxisOp]
    axes: tuple[int, ...]
    line: int | None = None

    @classmethod
    def named(cls, name: str) -> Setting | None:
        """The setting that `name` stands for; None if it is no such name."""
        match = _NAME.fullmatch(name)
        if match is None or int(match[2]) not in (0, *ir.AXES):
            return None
        axes = (int(match[2]),) if int(match[2]) else ir.AXES
        return cls(SETTINGS[match[1]], axes, int(match[3]) if match[3] else None)

    def __str__(self) -> str:
        axis = 0 if self.axes == ir.AXES else self.axes[0]
        at = "" if self.line is None else f"@{self.line}"
        return f"{self.kind.statement.mnemonic()}{axis}{at}"

    def places(self, program: ir.Program) -> set[tuple[int, int]]:
        """The index of each operation that it changes, with each axis for which it does."""
        return {
            (index, axis)
            for index, op in enumerate(program.ops)
            if isinstance(op, self.kind) and self.line in (None, op.span.line)
            for axis in op.axes
            if axis in self.axes
        }

    def changed(self, program: ir.Program, value: Fraction | bool) -> ir.Program:
        """`program` with `value` in these places, as its statement writes it.

        An operation on more axes than it changes becomes two.
        """
        if self.kind is ir.SetAcceleration:
            value = Fraction(value) * MS_PER_S
        indices = {index for index, _ in self.places(program)}
        ops: list[ir.Op] = []
        for index, op in enumerate(program.ops):
            ops += self._parts(op, value) if index in indices else [op]
        return replace(program, ops=tuple(ops))

    def _parts(self, op: ir.Op, value: Fraction | bool) -> Iterator[ir.Op]:
        assert isinstance(op, ir.AxisOp)
        own: dict[str, Any] = {fields(self.kind)[-1].name: value}
        others = tuple(axis for axis in op.axes if axis not in self.axes)
        if others:
            yield replace(op, axes=others)
        axes = tuple(axis for axis in op.axes if axis in self.axes)
        yield replace(op, axes=axes, **own)


def settings_of(program: ir.Program) -> list[str]:
    """The names of the settings that `program` states, of single axes."""
    every = (Setting(kind, (axis,)) for axis in ir.AXES for kind in SETTINGS.values())
    return [str(setting) for setting in every if setting.places(program)]


def microsteps_per_uu(program: ir.Program, axes: tuple[int, ...]) -> Fraction | None:
    """The user unit of these axes, if it is the same wherever the program states one."""
    stated = {
        op.microsteps_per_uu
        for op in program.ops
        if isinstance(op, ir.SetUnits) and set(op.axes) & set(axes)
    }
    return stated.pop() if len(stated) == 1 else None
