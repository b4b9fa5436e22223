"""The rule on comments, and the quantities that they state beside statements."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, NamedTuple

from mopro.errors import Severity
from mopro.language import ast
from mopro.lint.rule import Finding, Rule, Stage, Subject
from mopro.program import ir
from mopro.units import UNITS

# -- comments ---------------------------------------------------------------------------------
# Quantities stated in comments, and the statements that they belong to.


_NUMBER = r"(?<![\w.])([+-]?(?:\d+\.?\d*|\.\d+))"
_LENGTH = r"(in|inch|inches|mm|cm|m|um)"
_ACCELERATION = re.compile(
    _NUMBER + r"\s*" + _LENGTH + r"\s*/\s*s(?:ec)?\s*(?:\^\s*2|2|²|\s*/\s*s(?:ec)?)", re.I
)
_VELOCITY = re.compile(_NUMBER + r"\s*" + _LENGTH + r"\s*/\s*s(?:ec)?(?!\s*(?:\^|/|2|²|\w))", re.I)
_TIME = re.compile(_NUMBER + r"\s*(ms|msec|s|sec|seconds?|min)\b(?!\s*[/^])", re.I)
_NAMES = {
    "inch": "in", "inches": "in", "msec": "ms", "sec": "s", "second": "s",
    "seconds": "s",
}  # fmt: skip
PATTERNS: dict[type[ast.Statement], re.Pattern[str]] = {
    ast.Velocity: _VELOCITY,
    ast.Acceleration: _ACCELERATION,
    ast.Dwell: _TIME,
}


class Claim(NamedTuple):
    """A quantity in a comment, in SI; `rounding` is half a unit of its last digit."""

    text: str
    value: Fraction
    rounding: Fraction

    def agrees_with(self, value: Fraction) -> bool:
        """True if `value` rounds to the stated one, or differs by at most 1 %."""
        return abs(value - self.value) <= max(self.rounding, abs(self.value) / 100)


def claims(comment: str, kind: type[ast.Statement]) -> list[Claim]:
    """The quantities in `comment` of the dimension that a statement of `kind` sets."""
    return [_claim(match) for match in PATTERNS[kind].finditer(comment)]


def _claim(match: re.Match[str]) -> Claim:
    unit = match[2].lower()
    factor = UNITS[_NAMES.get(unit, unit)][1]
    decimals = len(match[1].partition(".")[2])
    return Claim(match[0], Fraction(match[1]) * factor, Fraction(1, 2 * 10**decimals) * factor)


def beside(tree: ast.Tree) -> Iterator[tuple[ast.Statement, ast.Comment]]:
    """Each statement with a quantity, and the comment beside it or on the line above."""
    by_line = {comment.span.line: comment for comment in tree.comments}
    busy = {statement.span.line for statement in tree.statements}
    for statement in tree.statements:
        if type(statement) not in PATTERNS:
            continue
        line = statement.span.line
        comment = by_line.get(line)
        if comment is None and line - 1 not in busy:
            comment = by_line.get(line - 1)
        if comment is not None:
            yield statement, comment


# -- the rule ---------------------------------------------------------------------------------
# The rule that compares comments with the statements that they stand beside.


def _comment_disagrees(rule: Rule, subject: Subject) -> Iterator[Finding]:

    units: dict[int, Fraction] = {}
    comments = {s.span: c for s, c in beside(subject.tree)}
    for statement, op in zip(subject.tree.statements, subject.program.ops, strict=True):
        if isinstance(op, ir.SetUnits):
            units.update(dict.fromkeys(op.axes, op.microsteps_per_uu))
        comment = comments.get(statement.span)
        said = claims(comment.text, type(statement)) if comment else []
        value = _in_si(subject, op, units) if said else None
        if value is not None and not any(claim.agrees_with(value) for claim in said):
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
