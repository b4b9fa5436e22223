"""One open text as an editor queries it, in lines and columns; free of the protocol."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

from mopro.language import ast
from mopro.language.parse import parse_what_can_be
from mopro.lint import Finding, Settings, lint
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
