"""The motion IR: one small frozen operation per statement.

Numbers are exact. `_uu` is a program's own user unit. Two programs are equal when they
ask for the same, wherever the statements stood: spans do not take part in equality.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import ClassVar

from mopro.errors import Diagnostic
from mopro.language import ast
from mopro.source import Source, Span

AXES = (1, 2)


@dataclass(frozen=True, slots=True)
class Op:
    """Base of all operations.

    `statement` is the form in which a program writes it: the fields of an operation stand
    for the operands of that statement, in the same order. `seeks_switch` tells that it
    runs an axis to a limit switch, `is_setting` that it moves nothing and stays in force.
    """

    statement: ClassVar[type[ast.Statement]]
    seeks_switch: ClassVar[bool] = False
    is_setting: ClassVar[bool] = False
    span: Span = field(compare=False, repr=False)

    def written_as(self) -> type[ast.Statement]:
        return self.statement


@dataclass(frozen=True, slots=True)
class AxisOp(Op):
    """An operation on `axes`, in ascending order."""

    axes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AxisVelocity(AxisOp):
    """Base of operations with a velocity in user units per second."""

    velocity_uu_s: Fraction


@dataclass(frozen=True, slots=True)
class AxisDistance(AxisOp):
    """Base of operations with a distance, or a position where `absolute`."""

    absolute_statement: ClassVar[type[ast.Statement]]
    distance_uu: Fraction
    absolute: bool = False

    def written_as(self) -> type[ast.Statement]:
        return self.absolute_statement if self.absolute else self.statement


@dataclass(frozen=True, slots=True)
class NamedOp(Op):
    """Base of operations with a label's name, in capitals."""

    name: str


@dataclass(frozen=True, slots=True)
class SetUnits(AxisOp):
    """Microsteps per user unit, as the ratio that the program states."""

    statement = ast.Units
    is_setting = True
    numerator: int
    denominator: int

    @property
    def microsteps_per_uu(self) -> Fraction:
        return Fraction(self.numerator, self.denominator)


class SetVelocity(AxisVelocity):
    """Peak velocity in user units per second."""

    __slots__ = ()
    statement = ast.Velocity
    is_setting = True


@dataclass(frozen=True, slots=True)
class SetAcceleration(AxisOp):
    """Acceleration in user units per second squared (the text has 1/1000 of it)."""

    statement = ast.Acceleration
    is_setting = True
    acceleration_uu_s2: Fraction


@dataclass(frozen=True, slots=True)
class SetProfile(AxisOp):
    """Parabolic velocity profiles on or off."""

    statement = ast.Profile
    is_setting = True
    parabolic: bool


class Move(AxisDistance):
    """Start moving now, by `distance_uu`, or to that position where `absolute`."""

    __slots__ = ()
    statement = ast.Move
    absolute_statement = ast.MoveAbsolute


class SetTarget(AxisDistance):
    """Target of the next `Go` for these axes; as for `Move`."""

    __slots__ = ()
    statement = ast.Target
    absolute_statement = ast.TargetAbsolute
    is_setting = True


class Go(Op):
    """Start all axes that have a target, together."""

    __slots__ = ()
    statement = ast.Go


class WaitAxis(AxisOp):
    """Wait until the axes have finished their motion."""

    __slots__ = ()
    statement = ast.WaitAxis


@dataclass(frozen=True, slots=True)
class Dwell(Op):
    """Wait; a program says whole milliseconds, a slow controller may add parts of one."""

    statement = ast.Dwell
    milliseconds: int | Fraction


class Label(NamedOp):
    """A place to jump to; `name` is in capitals."""

    __slots__ = ()
    statement = ast.Label


class Jump(NamedOp):
    """Go on at the label `name`."""

    __slots__ = ()
    statement = ast.Jump


class Continuous(AxisVelocity):
    """Change to this velocity in user units per second and keep it (assumed)."""

    __slots__ = ()
    statement = ast.Continuous


class Seek(AxisVelocity):
    """Move at this velocity until a limit switch, then stop (assumed)."""

    __slots__ = ()
    statement = ast.Seek
    seeks_switch = True


class Stop(AxisOp):
    """Slow down to rest at the set acceleration (assumed)."""

    __slots__ = ()
    statement = ast.Stop


class Home(AxisOp):
    """Seek the switch at the negative end at the set velocity; it becomes position 0 (assumed)."""

    __slots__ = ()
    statement = ast.Home
    seeks_switch = True


class ZeroPosition(AxisOp):
    """Count absolute positions from where the axes rest; nothing moves (assumed)."""

    __slots__ = ()
    statement = ast.ZeroPosition


@dataclass(frozen=True)
class Program:
    """A program ready to be run, linted or sent; `warnings` are what compiling found."""

    ops: tuple[Op, ...]
    source: Source = field(compare=False, repr=False)
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False, repr=False)

    @property
    def name(self) -> str:
        """The file's name without its folders."""
        return self.source.name.replace("\\", "/").rsplit("/", 1)[-1]

    @cached_property
    def labels(self) -> dict[str, int]:
        """Label name to the index of its operation."""
        return {op.name: i for i, op in enumerate(self.ops) if isinstance(op, Label)}

    @cached_property
    def _path(self) -> tuple[tuple[int, ...], bool]:
        """The indices that a run meets, once each, and whether it then begins them anew.

        The language has no condition, so a run is a beginning and at most one loop.
        """
        index, met = 0, dict[int, None]()
        while index < len(self.ops) and index not in met:
            met[index] = None
            op = self.ops[index]
            index = self.labels[op.name] if isinstance(op, Jump) else index + 1
        return tuple(met), index in met

    def _repr_html_(self) -> str:
        from mopro.markup import MOST_LINES, fragment, listing

        ending = ", loops for ever" if self.loops_forever else ""
        warned = f", {len(self.warnings)} warnings" if self.warnings else ""
        title = f"Program {self.name}: {len(self.ops)} statements{ending}{warned}"
        return fragment(title, [listing(self.source.text, MOST_LINES)])

    @property
    def seeks_switch(self) -> bool:
        """True if any operation runs an axis to a limit switch."""
        return any(op.seeks_switch for op in self.ops)

    @property
    def loops_forever(self) -> bool:
        return self._path[1]

    def reachable(self) -> Iterator[Op]:
        """The operations that a run meets, once each, in the order of meeting them."""
        return (self.ops[index] for index in self._path[0])
