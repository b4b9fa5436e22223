"""The canonical layout of a program text: same statements, same comments, tidy lines.

One statement a line from column 1, mnemonics in capitals, one space where the language
wants one and none where it does not; a comment behind a statement follows two spaces,
one on its own line keeps its indentation; at most one blank line in a row and none at
the ends. Values, names and comments stay as they were written, and so does the kind of
line end.
"""

from __future__ import annotations

from dataclasses import fields, replace

from mopro.errors import SourceError
from mopro.language import ast
from mopro.language.parse import parse_what_can_be
from mopro.source import Source


def format_source(source: Source, grammar: str = "attested") -> Source:
    """`source` in the canonical layout; SourceError if a line is not of the language."""
    tree, faults = parse_what_can_be(source, grammar)
    if faults:
        raise SourceError(source, faults)
    lines = [""] * len(source.lines)
    for statement in tree.statements:
        lines[statement.span.line - 1] = statement_text(statement, source)
    for comment in tree.comments:
        index = comment.span.line - 1
        before = f"{lines[index]}  " if lines[index] else _indentation(source.lines[index])
        lines[index] = before + comment.text
    end = source.line_end
    return replace(source, text="".join(line + end for line in _without_gaps(lines)))


def statement_text(statement: ast.Statement, source: Source) -> str:
    """`statement` in the canonical layout, its operands as they stand in `source`."""
    line = source.line(statement.span.line)
    operands = (getattr(statement, field.name) for field in fields(statement))
    texts = [
        line[operand.column - 1 : operand.end_column - 1]
        for operand in operands
        if isinstance(operand, ast.Operand)
    ]
    return statement.layout.format(*texts)


def _indentation(line: str) -> str:
    return line[: len(line) - len(line.lstrip(" \t"))].replace("\f", "").replace("\v", "")


def _without_gaps(lines: list[str]) -> list[str]:
    """At most one blank line in a row, none first or last."""
    kept: list[str] = []
    for line in lines:
        if line or (kept and kept[-1]):
            kept.append(line)
    if kept and not kept[-1]:
        kept.pop()
    return kept
