"""The tree of a program: one frozen dataclass per statement form.

A statement knows its span; its operands know their columns, so that one operand can be
shared by equal lines at different places.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from mopro.source import Source, Span
from mopro.text import snake_case


@dataclass(frozen=True, slots=True)
class Operand:
    """A value behind a mnemonic, with its columns (from 1, the end exclusive)."""

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
    """Base of all statements.

    A class with a `form` is a statement of the language: `rule()` is its alternative of
    `_statement` in a grammar file, whose operands are the class' fields in their order.
    `form` is an example as a person writes one, `layout` the canonical text with a
    `{}` for each operand, `meaning` what it does, in a few words.
    """

    form: ClassVar[str] = ""
    layout: ClassVar[str] = ""
    meaning: ClassVar[str] = ""
    span: Span

    @classmethod
    def rule(cls) -> str:
        return snake_case(cls.__name__)

    @classmethod
    def mnemonic(cls) -> str:
        """The letters, or the colon, that begin such a statement."""
        return cls.layout.partition("{")[0].strip()


@dataclass(frozen=True, slots=True)
class AxisStatement(Statement):
    """Base of statements about an axis."""

    axis: Axis


@dataclass(frozen=True, slots=True)
class AxisValue(AxisStatement):
    """Base of statements that give an axis a value."""

    value: Number


@dataclass(frozen=True, slots=True)
class LabelStatement(Statement):
    """Base of statements that name a label."""

    name: Name


@dataclass(frozen=True, slots=True)
class Units(AxisStatement):
    form = "UU012500/1"
    layout = "UU{}{}/{}"
    meaning = "user units: microsteps per user unit, as a ratio"
    numerator: Whole
    denominator: Whole


# Those without operands of their own need no methods of their own either.


class Velocity(AxisValue):
    __slots__ = ()
    form = "VEL1 40.0"
    layout = "VEL{} {}"
    meaning = "peak velocity in user units per second"


class Acceleration(AxisValue):
    __slots__ = ()
    form = "ACC1 0.25"
    layout = "ACC{} {}"
    meaning = "acceleration in user units per second per millisecond"


@dataclass(frozen=True, slots=True)
class Profile(AxisStatement):
    form = "PARA1+"
    layout = "PARA{}{}"
    meaning = "parabolic velocity profile on (+) or off (-)"
    switch: Switch


class Move(AxisValue):
    __slots__ = ()
    form = "MRI1 15.0"
    layout = "MRI{} {}"
    meaning = "move by this distance, now"


class Target(AxisValue):
    __slots__ = ()
    form = "MR1 8.0"
    layout = "MR{} {}"
    meaning = "where the next GO takes the axis, from here"


class Go(Statement):
    __slots__ = ()
    form = "GO"
    layout = "GO"
    meaning = "start all axes that have a target, together"


class WaitAxis(AxisStatement):
    __slots__ = ()
    form = "WX1"
    layout = "WX{}"
    meaning = "wait until the axis has finished its motion"


@dataclass(frozen=True, slots=True)
class Dwell(Statement):
    form = "WT2000"
    layout = "WT{}"
    meaning = "wait this many milliseconds"
    milliseconds: Whole


class Label(LabelStatement):
    __slots__ = ()
    form = ":B1"
    layout = ":{}"
    meaning = "a place to jump to"


class Jump(LabelStatement):
    __slots__ = ()
    form = "JUMP B1"
    layout = "JUMP {}"
    meaning = "go on at the label"


class MoveAbsolute(AxisValue):
    __slots__ = ()
    form = "MAI1 15.0"
    layout = "MAI{} {}"
    meaning = "move to this position, now (assumed)"


class TargetAbsolute(AxisValue):
    __slots__ = ()
    form = "MA1 8.0"
    layout = "MA{} {}"
    meaning = "where the next GO takes the axis (assumed)"


class Continuous(AxisValue):
    __slots__ = ()
    form = "MC1 10.0"
    layout = "MC{} {}"
    meaning = "keep this velocity from now on (assumed)"


class Seek(AxisValue):
    __slots__ = ()
    form = "SK1 -5.0"
    layout = "SK{} {}"
    meaning = "move at this velocity to a limit switch (assumed)"


class Stop(AxisStatement):
    __slots__ = ()
    form = "ST1"
    layout = "ST{}"
    meaning = "slow down to rest (assumed)"


class Home(AxisStatement):
    __slots__ = ()
    form = "HM1"
    layout = "HM{}"
    meaning = "find the switch at the negative end; it becomes position 0 (assumed)"


class ZeroPosition(AxisStatement):
    __slots__ = ()
    form = "ZP1"
    layout = "ZP{}"
    meaning = "the present position becomes 0; nothing moves (assumed)"


# All statements, by the name of their grammar rule, in the order of the classes above.
STATEMENTS: Mapping[str, type[Statement]] = {
    kind.rule(): kind
    for kind in list(vars().values())
    if isinstance(kind, type) and issubclass(kind, Statement) and kind.form
}


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
