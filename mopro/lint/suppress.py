"""Suppression of findings by comments in the program."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Collection, Iterator
from typing import NamedTuple

from mopro.language import ast
from mopro.source import Span

_ALLOW = re.compile(r";\s*mopro:\s*allow\b[\s:]*([A-Za-z0-9_\-, \t]*)", re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z0-9_\-]+")


class Allow(NamedTuple):
    """Suppression of `rule` in `line`, stated at `span`."""

    rule: str
    line: int
    span: Span


def allows(tree: ast.Tree) -> Iterator[Allow]:
    """Suppressions by comments, for their own line or the next one with a statement."""
    lines = [statement.span.line for statement in tree.statements]
    for comment in tree.comments:
        match = _ALLOW.match(comment.text)
        if match is None:
            continue
        index = bisect_left(lines, comment.span.line)
        line = lines[index] if index < len(lines) else comment.span.line
        for name in _NAME.finditer(match[1]):
            start = comment.span.column + match.start(1) + name.start()
            yield Allow(name[0].lower(), line, Span(comment.span.line, start, start + len(name[0])))


def why_unused(allow: Allow, known: Collection[str]) -> tuple[str, str | None]:
    """Message and hint for a suppression without a finding."""
    if allow.rule in known:
        return f"{allow.rule} is allowed here, but there is none", "remove the comment"
    from difflib import get_close_matches

    near = get_close_matches(allow.rule, list(known), n=1)
    return f"no rule is called {allow.rule}", f"did you mean `{near[0]}`?" if near else None
