"""Program text and places in it.

Lines and columns count from 1, as editors show them; an end column is the column
after the last character.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

_LINE_END = re.compile(r"\r\n|\n|\r")
_LINE_WITH_END = re.compile(r"[^\r\n]*(?:\r\n|\n|\r|\Z)")


class Span(NamedTuple):
    """A stretch of one source line."""

    line: int
    column: int
    end_column: int

    def __str__(self) -> str:
        return f"{self.line}:{self.column}"


@dataclass(frozen=True)
class Source:
    """One program text with the name that messages give it.

    `encoding` is the one that turns `text` back into the bytes it came from, behind `mark`;
    `sha256` is the digest of those bytes. `cut`: where a mark ended the text, of what stands behind
    it as well.
    """

    name: str
    text: str
    encoding: str = "utf-8"
    cut: Span | None = field(default=None, compare=False)
    mark: bytes = b""

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The lines without their ends; a final line end opens no further line."""
        lines = _LINE_END.split(self.text)
        if lines[-1] == "":
            lines.pop()
        return tuple(lines)

    @property
    def lines_with_ends(self) -> list[str]:
        """The lines with their ends, as they stand; together they are the text."""
        return [line for line in _LINE_WITH_END.findall(self.text) if line]

    @property
    def line_end(self) -> str:
        """The line end that the text has most often; a line feed if it has none."""
        ends = _LINE_END.findall(self.text)
        return max(("\n", "\r\n", "\r"), key=ends.count)

    @cached_property
    def sha256(self) -> str:
        import hashlib

        return hashlib.sha256(self.encoded).hexdigest()

    @property
    def encoded(self) -> bytes:
        """The text as the bytes it came from."""
        return self.mark + self.text.encode(self.encoding)

    def line(self, number: int) -> str:
        """The text of line `number`; empty beyond the last line."""
        return self.lines[number - 1] if 1 <= number <= len(self.lines) else ""

    def excerpt(self, span: Span, width: int = 100) -> str:
        """The span's line and a caret line below it, cut to `width` around the span.

        Tabs and other controls are shown as single spaces so that the caret stays
        under its column.
        """
        line = self.line(span.line)
        start = span.column - 1
        left = max(0, start - width // 2) if len(line) > width else 0
        cut = "".join(c if c.isprintable() else " " for c in line[left : left + width])
        marked = max(1, min(span.end_column - span.column, len(cut) - (start - left)))
        return f"  {cut}\n  {' ' * (start - left)}{'^' + '~' * (marked - 1)}"
