"""Quantities stated in comments, and the statements that they belong to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from mopro.language import ast
from mopro.units import UNITS

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
