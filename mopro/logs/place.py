"""Places of cells in a file that is not held in memory."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from mopro.source import Source, Span

MOST_CHARACTERS = 10_000
_COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class LogSource(Source):
    """A log whose text is not held in memory; `line` reads the line that a message shows."""

    path: Path = field(default=Path())
    is_text: bool = True

    def line(self, number: int) -> str:
        if not self.is_text:
            return ""
        try:
            with open(self.path, encoding=self.encoding, errors="replace", newline=None) as file:
                return next(islice(_cut(file), number - 1, number), "").rstrip("\r\n")
        except OSError:
            return ""


def _cut(file: Iterator[str]) -> Iterator[str]:
    return (line[:MOST_CHARACTERS] for line in file)


def cell_span(text: str, line: int, nth: int, delimiter: str) -> Span:
    """Span of the `nth` cell of a line; the line's end for a cell that is not there."""
    starts = _starts(text, delimiter)
    if nth >= len(starts) - 1:
        return Span(line, len(text) + 1, len(text) + 2)
    start, end = starts[nth], starts[nth + 1] - 1
    lead = len(text[start:end]) - len(text[start:end].lstrip())
    return Span(line, start + lead + 1, max(end, start + lead + 1) + 1)


def _starts(text: str, delimiter: str) -> list[int]:
    """Start of each cell, and one past the line's end: delimiters in a quoted cell do not count."""
    starts, quoted = [0], False
    for index, character in enumerate(text):
        if character == '"':
            quoted ^= text[starts[-1] : index + 1].lstrip().startswith('"')
        if character == delimiter and not quoted:
            starts.append(index + 1)
    return [*starts, len(text) + 1]


def cells_of(text: str, delimiter: str) -> list[str]:
    """The cells of one line, without the blanks around them and without a mark of a comment."""
    if delimiter == " ":
        words = text.split()
        return words[1:] if words and words[0] in _COMMENTS else words
    try:
        row = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        row = text.split(delimiter)
    return [cell.strip() for cell in row]
