"""Lines between the rows of a text that are no rows: notes, headings again, remarks behind rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mopro.logs.cell_kinds import MISSING, holds_data, is_word
from mopro.logs.layout import Layout
from mopro.logs.log import Decision, cells_of

NOTE = "notes between the rows, no rows of the table"
HEADING = "headings again"
# Ends a text under DOS; files that DOS joined have it in their middle.
DOS_END = "\x1a"
_MOST_TOLD = 5
_STARTS = frozenset("0123456789+-.")


@dataclass(frozen=True)
class Tidied:
    """The rows of a text without the lines between them: UTF-8, and the number of each line."""

    data: bytes
    numbers: NDArray[np.int64]
    left_out: dict[str, int]
    decisions: tuple[Decision, ...]


def tidied(path: Path, layout: Layout) -> Tidied | None:
    """The rows of the text in file `path`; None if all its lines are rows as they are."""
    try:
        return _Tidying(layout).of(path)
    except UnicodeDecodeError:
        return None


class _Tidying:
    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._width = len(layout.names)
        words = [all(map(is_word, filled)) for filled in _filled(layout)]
        self._words_first = bool(words) and words[0]
        self._count = {NOTE: 0, HEADING: 0}
        self._first = {NOTE: 0, HEADING: 0}
        self._remarks = 0
        # The line of each Ctrl-Z, and the first line that has text behind it.
        self._ends: list[tuple[int, int]] = []

    def of(self, path: Path) -> Tidied | None:
        layout, rows, numbers = self._layout, [], []
        with open(path, encoding=layout.encoding, newline=None) as file:
            for number, line in enumerate(file, start=1):
                if DOS_END in line:
                    behind = line.partition(DOS_END)[2].strip(DOS_END + "\n ")
                    self._ends.append((number, number if behind else number + 1))
                    line = line.replace(DOS_END, "")
                if number < layout.first_line or not line.strip():
                    continue
                kept = self._kept(line.rstrip("\n"), number)
                if kept is not None:
                    rows.append(kept)
                    numbers.append(number)
        if not rows or not (any(self._count.values()) or self._remarks or self._ends):
            return None
        data = "\n".join(rows).encode("utf-8", "replace") + b"\n"
        left_out = {why: count for why, count in self._count.items() if count}
        decisions = (*self._decisions(), *self._end_decisions(numbers[-1]))
        return Tidied(data, np.array(numbers, np.int64), left_out, decisions)

    def _kept(self, line: str, number: int) -> str | None:
        """The line as a row; None if it is none. A row of another width stays as it is."""
        delimiter, width = self._layout.delimiter, self._width
        if line[0] in _STARTS and line.count(delimiter) == width - 1:
            return line
        cells = cells_of(line, delimiter)
        why = self._why(cells)
        if why is not None:
            self._count[why] += 1
            self._first[why] = self._first[why] or number
            return None
        excess = cells[width:]
        if excess and all(not cell or cell[0].isalpha() for cell in excess):
            self._remarks += any(excess)
            return delimiter.join(_quoted(cell, delimiter) for cell in cells[:width])
        return line

    def _why(self, cells: list[str]) -> str | None:
        if tuple(cells[: self._width]) == self._layout.headings:
            return HEADING
        if not any(map(holds_data, cells)):
            blank = all(cell.lower() in MISSING for cell in cells)
            return None if blank and len(cells) == self._width else NOTE
        other = len(cells) != self._width and is_word(cells[0])
        return NOTE if other and not self._words_first else None

    def _decisions(self) -> list[Decision]:
        found = [
            Decision(f"{count} lines", "left out", f"{why}; the first is line {self._first[why]}")
            for why, count in self._count.items()
            if count
        ]
        if self._remarks:
            taken = f"left out behind {self._remarks} rows"
            found.append(Decision("cells without a heading", taken, "they are words"))
        return found

    def _end_decisions(self, last: int) -> Iterator[Decision]:
        """Each Ctrl-Z that is not behind the last row, which is in line `last`."""
        for line in [line for line, behind in self._ends if behind <= last][:_MOST_TOLD]:
            taken = "a Ctrl-Z (0x1A), at which a text ends under DOS: what follows it is read, too"
            reason = "files that DOS joined have it; if the log ends there, cut the file there"
            yield Decision(f"line {line}", taken, reason, check=True, lasting=True)


def _filled(layout: Layout) -> list[list[str]]:
    """The cells of each column of the first rows that are not blank."""
    columns = zip(*layout.sample, strict=True)
    return [[c for c in cells if c.lower() not in MISSING] for cells in columns]


def _quoted(cell: str, delimiter: str) -> str:
    return f'"{cell}"' if delimiter in cell else cell
