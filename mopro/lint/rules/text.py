"""Rules about the program as it is written; they need no machine and no motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mopro.errors import Severity
from mopro.lint.promises import same_but_labels
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
    """One finding for each stretch that no run comes to."""
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
        why="A loop that was meant to be closed, or a label left over, is told apart by a look.",
        bad=":B1\nWT100\n",
        good=":B1\nWT100\nJUMP B1\n",
        promise=same_but_labels,
    ),
    _warning(
        "unreachable",
        _unreachable,
        what="Statements that no run comes to.",
        why="The language has no condition: what stands after a jump and is not jumped to "
        "never happens, a final stop or a way home included.",
        bad=":B1\nWT100\nJUMP B1\nWT200\n",
        good=":B1\nWT100\nWT200\nJUMP B1\n",
    ),
    _warning(
        "unused-allow",
        None,
        what="A comment `mopro: allow RULE` that allows nothing.",
        why="The danger that it was written for is gone, or it names no rule: it would hide the "
        "next one.",
        bad="WT100 ; mopro: allow stall\n",
        good="WT100 ; no stall in sight\n",
    ),
)
