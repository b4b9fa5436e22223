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
class Units(Statement):
    form = "UU012500/1"
    axis: Axis
    numerator: Whole
    denominator: Whole


@dataclass(frozen=True, slots=True)
class Velocity(Statement):
    form = "VEL1 40.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Acceleration(Statement):
    form = "ACC1 0.25"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Profile(Statement):
    form = "PARA1+"
    axis: Axis
    switch: Switch


@dataclass(frozen=True, slots=True)
class Move(Statement):
    form = "MRI1 15.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Target(Statement):
    form = "MR1 8.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Go(Statement):
    form = "GO"


@dataclass(frozen=True, slots=True)
class WaitAxis(Statement):
    form = "WX1"
    axis: Axis


@dataclass(frozen=True, slots=True)
class Dwell(Statement):
    form = "WT2000"
    milliseconds: Whole


@dataclass(frozen=True, slots=True)
class Label(Statement):
    form = ":B1"
    name: Name


@dataclass(frozen=True, slots=True)
class Jump(Statement):
    form = "JUMP B1"
    name: Name


@dataclass(frozen=True, slots=True)
class MoveAbsolute(Statement):
    form = "MAI1 15.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class TargetAbsolute(Statement):
    form = "MA1 8.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Continuous(Statement):
    form = "MC1 10.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Seek(Statement):
    form = "SK1 -5.0"
    axis: Axis
    value: Number


@dataclass(frozen=True, slots=True)
class Stop(Statement):
    form = "ST1"
    axis: Axis


@dataclass(frozen=True, slots=True)
class Home(Statement):
    form = "HM1"
    axis: Axis


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
