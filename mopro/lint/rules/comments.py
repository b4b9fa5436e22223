"""The rule that compares comments with the statements that they stand beside."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from mopro.errors import Severity
from mopro.language import ast
from mopro.lint.rule import Finding, Rule, Stage
from mopro.lint.subject import Subject
from mopro.program import ir


def _comment_disagrees(rule: Rule, subject: Subject) -> Iterator[Finding]:
    from mopro.lint.comments import beside, claims

    units: dict[int, Fraction] = {}
    comments = {s.span: c for s, c in beside(subject.tree)}
    for statement, op in zip(subject.tree.statements, subject.program.ops, strict=True):
        if isinstance(op, ir.SetUnits):
            units.update(dict.fromkeys(op.axes, op.microsteps_per_uu))
        comment = comments.get(statement.span)
        value = _in_si(subject, op, units) if comment else None
        if comment is None or value is None:
            continue
        said = claims(comment.text, type(statement))
        if said and not any(claim.agrees_with(value) for claim in said):
            yield rule.at(
                statement.span,
                f"the comment says {said[0].text}, the statement means "
                f"{_as_meant(subject, statement, value, units, op)}",
                "correct the one that is wrong",
            )


def _in_si(subject: Subject, op: ir.Op, units: dict[int, Fraction]) -> Fraction | None:
    """Value that a statement sets, in SI; None where its user unit is not set."""
    if isinstance(op, ir.Dwell):
        return Fraction(op.milliseconds, 1000)
    if not isinstance(op, ir.SetVelocity | ir.SetAcceleration) or op.axes[0] not in units:
        return None
    value = op.velocity_uu_s if isinstance(op, ir.SetVelocity) else op.acceleration_uu_s2
    return value * subject.metres_per_uu(units[op.axes[0]])


def _as_meant(
    subject: Subject, statement: ast.Statement, value: Fraction, units: dict[int, Fraction], op: Any
) -> str:
    if isinstance(op, ir.Dwell):
        return f"{float(value):g} s"
    microsteps = units[op.axes[0]]
    per = "s²" if isinstance(op, ir.SetAcceleration) else "s"
    shown = float(value / subject.metres_per_uu(microsteps))
    return f"{shown:.6g} {subject.unit(microsteps)}/{per}"


RULES = (
    Rule(
        "comment-disagrees",
        Stage.PHYSICS,
        Severity.WARNING,
        check=_comment_disagrees,
        what="A comment that gives a velocity, acceleration or time other than the statement's.",
        why="One of the two is wrong. A common cause: ACC states acceleration per second and per "
        "millisecond.",
        bad="UU012500/1\nACC1 250.0 ; 250 in/s^2\n",
        good="UU012500/1\nACC1 0.25 ; 250 in/s^2\n",
    ),
)
