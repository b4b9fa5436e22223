"""Rules about the text of a program; they need no machine and no motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mopro.errors import Severity
from mopro.lint.fix_checks import same_but_labels
from mopro.lint.rule import Finding, Rule, Stage
from mopro.lint.subject import Subject
from mopro.program import ir


def _unused_label(rule: Rule, subject: Subject) -> Iterator[Finding]:
    used = {op.name for op in subject.program.ops if isinstance(op, ir.Jump)}
    for op in subject.program.ops:
        if isinstance(op, ir.Label) and op.name not in used:
            hint = "remove it, or jump to it"
            yield rule.at(op.span, f"no line jumps to the label {op.name}", hint, fix="")


def _unreachable(rule: Rule, subject: Subject) -> Iterator[Finding]:
    """One finding for each block of statements that no run reaches."""
    told = False
    for index, op in enumerate(subject.program.ops):
        if index in subject.reached:
            told = False
        elif not told and not isinstance(op, ir.Label):
            told = True
            yield rule.at(op.span, "no run comes to this line", "jump to it, or remove it")


def _warning(name: str, check: Any, **texts: Any) -> Rule:
    return Rule(name, Stage.TEXT, Severity.WARNING, check=check, **texts)


RULES = (
    _warning(
        "unused-label",
        _unused_label,
        what="A label that no line jumps to.",
        why="Either a loop is not closed as intended, or the label is no longer needed.",
        bad=":B1\nWT100\n",
        good=":B1\nWT100\nJUMP B1\n",
        fix_check=same_but_labels,
    ),
    _warning(
        "unreachable",
        _unreachable,
        what="Statements that no run reaches.",
        why="The language has no conditions: statements after a jump, without a label that is "
        "jumped to, are never executed, including a final stop or return.",
        bad=":B1\nWT100\nJUMP B1\nWT200\n",
        good=":B1\nWT100\nWT200\nJUMP B1\n",
    ),
    _warning(
        "unused-allow",
        None,
        what="A comment `mopro: allow RULE` that allows nothing.",
        why="Its finding no longer occurs, or it names no rule; it could hide a later finding.",
        bad="WT100 ; mopro: allow stall\n",
        good="WT100 ; no stall in sight\n",
    ),
)
