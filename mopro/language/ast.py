"""The tree of a program: one frozen dataclass per statement form.

A statement knows its span; its operands know their columns, so that one operand can be
shared by equal lines at different places.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from mopro.source import Source, Span


@dataclass(frozen=True, slots=True)
class Operand:
    """What follows a mnemonic, with its columns."""

    column: int
    end_column: int

    def span(self, line: int) -> Span:
        return Span(line, self.column, self.end_column)


@dataclass(frozen=True, slots=True)
class Axis(Operand):
    """An axis digit; `letter_o` tells that the text has the letter O for the digit 0."""

    number: int
    letter_o: bool = False


@dataclass(frozen=True, slots=True)
class Number(Operand):
    """A plain decimal, exactly as written."""

    value: Fraction


@dataclass(frozen=True, slots=True)
class Whole(Operand):
    value: int


@dataclass(frozen=True, slots=True)
class Switch(Operand):
    on: bool


@dataclass(frozen=True, slots=True)
class Name(Operand):
    """A label's name; labels are the same in either letter case (assumed)."""

    text: str

    @property
    def key(self) -> str:
        return self.text.upper()


@dataclass(frozen=True, slots=True)
class Statement:
    """Base of all statements. `form` is how a person writes one."""

    form: ClassVar[str] = ""
    span: Span


@dataclass(frozen=True, slots=True)
class AxisStatement(Statement):
    """Base of what speaks of an axis."""

    axis: Axis


@dataclass(frozen=True, slots=True)
class AxisValue(AxisStatement):
    """Base of what gives an axis a value."""

    value: Number


@dataclass(frozen=True, slots=True)
class LabelStatement(Statement):
    """Base of what names a label."""

    name: Name


@dataclass(frozen=True, slots=True)
class Units(AxisStatement):
    form = "UU012500/1"
    numerator: Whole
    denominator: Whole


@dataclass(frozen=True, slots=True)
class Profile(AxisStatement):
    form = "PARA1+"
    switch: Switch


@dataclass(frozen=True, slots=True)
class Dwell(Statement):
    form = "WT2000"
    milliseconds: Whole


# Those without operands of their own need no methods of their own either.


class Velocity(AxisValue):
    __slots__ = ()
    form = "VEL1 40.0"


class Acceleration(AxisValue):
    __slots__ = ()
    form = "ACC1 0.25"


class Move(AxisValue):
    __slots__ = ()
    form = "MRI1 15.0"


class Target(AxisValue):
    __slots__ = ()
    form = "MR1 8.0"


class Go(Statement):
    __slots__ = ()
    form = "GO"


class WaitAxis(AxisStatement):
    __slots__ = ()
    form = "WX1"


class Label(LabelStatement):
    __slots__ = ()
    form = ":B1"


class Jump(LabelStatement):
    __slots__ = ()
    form = "JUMP B1"


class MoveAbsolute(AxisValue):
    __slots__ = ()
    form = "MAI1 15.0"


class TargetAbsolute(AxisValue):
    __slots__ = ()
    form = "MA1 8.0"


class Continuous(AxisValue):
    __slots__ = ()
    form = "MC1 10.0"


class Seek(AxisValue):
    __slots__ = ()
    form = "SK1 -5.0"


class Stop(AxisStatement):
    __slots__ = ()
    form = "ST1"


class Home(AxisStatement):
    __slots__ = ()
    form = "HM1"


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment from its semicolon to the end of its line, byte for byte."""

    span: Span
    text: str


@dataclass(frozen=True)
class Tree:
    """A parsed program: its statements and comments, each in order of place."""

    source: Source
    statements: tuple[Statement, ...]
    comments: tuple[Comment, ...]
