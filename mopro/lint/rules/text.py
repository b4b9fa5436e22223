"""Rules about the text of a program; they need no machine and no motion."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from typing import Any

from mopro.errors import Severity
from mopro.language.parse import is_statement
from mopro.lint.rule import Finding, Rule, Stage, Subject, same_but_labels
from mopro.program import ir
from mopro.source import Span

# Marks, embeddings, overrides and isolates of Unicode's bidirectional algorithm.
_DIRECTION = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def _unused_label(rule: Rule, subject: Subject) -> Iterator[Finding]:
    used = {op.name for op in subject.program.ops if isinstance(op, ir.Jump)}
    for op in subject.program.ops:
        if isinstance(op, ir.Label) and op.name not in used:
            hint = "remove it, or jump to it"
            yield rule.at(op.span, f"no line jumps to the label {op.name}", hint, fix="")


def _unreachable(rule: Rule, subject: Subject) -> Iterator[Finding]:
    """One finding for each block of statements that no run reaches."""
    reported = False
    for index, op in enumerate(subject.program.ops):
        if index in subject.reached:
            reported = False
        elif not reported and not isinstance(op, ir.Label):
            reported = True
            yield rule.at(op.span, "no run comes to this line", "jump to it, or remove it")


def _direction_control(rule: Rule, subject: Subject) -> Iterator[Finding]:
    """One finding for each line; an editor shows such a line in another order than it is read."""
    for number, line in enumerate(subject.program.source.lines, start=1):
        if found := _DIRECTION.search(line):
            name = unicodedata.name(found[0])
            span = Span(number, found.start() + 1, found.end() + 1)
            yield rule.at(span, f"{name} changes the order in which the line is shown")


def _statement_in_comment(rule: Rule, subject: Subject) -> Iterator[Finding]:
    """A comment behind a statement that is one itself; on a line of its own it is out of use."""
    lines = {statement.span.line for statement in subject.tree.statements}
    for comment in subject.tree.comments:
        said = comment.text.lstrip("; \t\f\v")
        if comment.span.line in lines and is_statement(said):
            stated = said.partition(";")[0].rstrip()
            message = f"`{stated}` is in the comment, and never carried out"
            yield rule.at(comment.span, message, "write it on a line of its own")


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
        "direction-control",
        _direction_control,
        what="An invisible character that changes the direction of text.",
        why="An editor shows the line in another order than the controller reads it: what looks "
        "like a comment can be a statement, and the other way round.",
        bad="WT100 ; wait \u202e001 TW\n",
        good="WT100 ; wait\n",
    ),
    _warning(
        "statement-in-comment",
        _statement_in_comment,
        what="A comment behind a statement that is a statement itself.",
        why="A line holds one statement, and `;` begins a comment: it does not part statements.",
        bad="WT100;WT200\n",
        good="WT100\nWT200\n",
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
