"""One open text as an editor queries it, in lines and columns; free of the protocol."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property, singledispatch

from mopro.errors import SourceError
from mopro.language import ast
from mopro.language.parse import parse_what_can_be
from mopro.lint import Finding, Settings, lint
from mopro.lint.check import subject_of
from mopro.lint.rule import Subject
from mopro.motion import PlannedMove
from mopro.program import ir
from mopro.source import Source, Span

_LABEL = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,29}")


@dataclass(frozen=True)
class Document:
    """One version of an open text."""

    source: Source
    settings: Settings

    @cached_property
    def tree(self) -> ast.Tree:
        """The statements of the lines that can be read."""
        return parse_what_can_be(self.source, self.settings.grammar)[0]

    @cached_property
    def findings(self) -> list[Finding]:
        return lint(self.source, self.settings)

    def statement_at(self, line: int) -> ast.Statement | None:
        return next((s for s in self.tree.statements if s.span.line == line), None)

    def name_at(self, line: int, column: int) -> tuple[str, Span] | None:
        """The label that stands at a place, in capitals, and where its name is."""
        for key, span, _ in self.names:
            if span.line == line and span.column <= column <= span.end_column:
                return key, span
        return None

    @cached_property
    def names(self) -> list[tuple[str, Span, bool]]:
        """Each label name in the text: in capitals, where, and whether that defines it."""
        return [
            (s.name.key, s.name.span(s.span.line), isinstance(s, ast.Label))
            for s in self.tree.statements
            if isinstance(s, ast.Label | ast.Jump)
        ]

    def places_of(self, key: str, with_definition: bool = True) -> list[Span]:
        return [
            span
            for name, span, defines in self.names
            if name == key and (with_definition or not defines)
        ]

    def definition_of(self, key: str) -> Span | None:
        return next((span for name, span, defines in self.names if name == key and defines), None)

    def text_of(self, statement: ast.Statement) -> str:
        span = statement.span
        return self.source.line(span.line)[span.column - 1 : span.end_column - 1]

    def why_no_name(self, name: str, old: str) -> str | None:
        """The reason why `name` cannot replace the label `old`; None if it can."""
        if not _LABEL.fullmatch(name):
            return f"`{name}` is no label: letters, digits and _, with no digit first"
        if name.upper() != old and self.definition_of(name.upper()) is not None:
            return f"there is a label {name} already"
        return None


# -- meaning ----------------------------------------------------------------------------------
# The meaning of a statement in words and in SI units: the text of a hover.


def hover(document: Document, line: int) -> str | None:
    """Markdown about the statement in `line`: what it is, its values decoded, its moves."""
    statement = document.statement_at(line)
    if statement is None:
        return None
    parts = [f"`{statement.form}`: {statement.meaning}"]
    try:
        subject = subject_of(document.source, document.settings)
    except SourceError:
        return parts[0]
    index = next(i for i, s in enumerate(subject.tree.statements) if s.span.line == line)
    op = subject.program.ops[index]
    parts += _values(op, subject, index)
    parts += _moves(subject, index)
    return "\n\n".join(parts)


def _values(op: ir.Op, subject: Subject, index: int) -> list[str]:
    words = decoded(op, subject, index)
    text = subject.program.source.line(op.span.line)[op.span.column - 1 : op.span.end_column - 1]
    return [f"`{text}` = {words}"] if words else []


@singledispatch
def decoded(op: ir.Op, subject: Subject, index: int) -> str:
    """The operation's values in the units that people think in; empty if it has none."""
    return ""


@decoded.register
def _(op: ir.SetUnits, subject: Subject, index: int) -> str:
    unit, microsteps = subject.unit(op.microsteps_per_uu), float(op.microsteps_per_uu)
    return f"{microsteps:g} microsteps of {subject.machine.microstep_m * 1e6:.4g} µm per {unit}"


@decoded.register
def _(op: ir.SetVelocity, subject: Subject, index: int) -> str:
    return _both(float(op.velocity_uu_s), "s", subject, op, index)


@decoded.register
def _(op: ir.SetAcceleration, subject: Subject, index: int) -> str:
    return _both(float(op.acceleration_uu_s2), "s²", subject, op, index)


@decoded.register
def _(op: ir.Dwell, subject: Subject, index: int) -> str:
    return f"{op.milliseconds / 1000:g} s"


def _both(value: float, per: str, subject: Subject, op: ir.AxisOp, index: int) -> str:
    """A value in the program's unit and in metres, as far as a unit is set above it."""
    before = subject.program.ops[:index]
    units = [o for o in before if isinstance(o, ir.SetUnits) and set(op.axes) & set(o.axes)]
    if not units:
        return f"{value:g} user units/{per}"
    ratio = units[-1].microsteps_per_uu
    metres = value * float(subject.metres_per_uu(ratio))
    return f"{value:g} {subject.unit(ratio)}/{per} = {metres:.4g} m/{per}"


def _moves(subject: Subject, index: int) -> list[str]:
    """The first few different moves that the statement starts, or sets a value for."""
    op = subject.program.ops[index]
    texts: dict[str, None] = {}
    for move in _concerned(op, subject):
        texts[_move_words(move, subject)] = None
    return list(texts)[:3]


def _concerned(op: ir.Op, subject: Subject) -> list[PlannedMove]:
    moves = subject.distinct_moves
    if isinstance(op, ir.SetVelocity | ir.SetAcceleration | ir.SetProfile):
        ops = subject.program.ops
        same = type(op)
        later = [
            o.span
            for o in ops
            if isinstance(o, same) and o.span > op.span and set(o.axes) & set(op.axes)
        ]
        until = later[0] if later else None
        return [
            m
            for m in moves
            if m.span > op.span and (until is None or m.span < until) and m.axes[0] in op.axes
        ]
    return [m for m in moves if m.span == op.span]


def _move_words(move: PlannedMove, subject: Subject) -> str:
    profile = move.profile
    unit = subject.unit(move.microsteps_per_uu)
    peak = move.in_uu(profile.peak_velocity)
    metres = profile.peak_velocity * subject.machine.microstep_m
    return (
        f"{profile.shape} over {move.in_uu(profile.distance):g} {unit}: reached peak {peak:.3g} "
        f"{unit}/s = {metres:.3g} m/s; {profile.duration_s:.3g} s"
    )
