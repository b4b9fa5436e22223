"""Building blocks of pages: all text is escaped."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Sequence
from typing import Any

from mopro.text import visible

_NUMBER = re.compile(r"[-+−]?\d|at most ")
# What stands in a column of numbers where there is none.
_NO_NUMBERS = ("", "–", "unknown", "nothing to hold out")


def escaped(text: str) -> str:
    """`text` for the inside of an element or of a quoted attribute."""
    return html.escape(visible(text))


def heading(text: str, level: int = 2) -> str:
    return f"<h{level}>{escaped(text)}</h{level}>"


def paragraph(text: str) -> str:
    return f"<p>{escaped(text)}</p>"


def listing(text: str) -> str:
    """Preformatted text, such as a program or a file."""
    return f"<pre>{escaped(text)}</pre>"


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a caption; without `columns` the first cell of each row is its head.

    Columns of numbers stand to the right.
    """
    lines = [f'<div class="table"><table>\n<caption>{escaped(caption)}</caption>']
    body = list(rows)
    kinds = [_kind(cells) for cells in zip(*body, strict=True)] if columns else ["", ""]
    if columns:
        heads = zip(columns, kinds or [""] * len(columns), strict=True)
        cells = "".join(f'<th scope="col"{kind}>{escaped(c)}</th>' for c, kind in heads)
        lines.append(f"<tr>{cells}</tr>")
    lines += [_row(cells, kinds, headed=not columns) for cells in body]
    return "\n".join([*lines, "</table></div>"])


def section(title: str, parts: Iterable[str], opened: bool = True) -> str:
    """Parts of a page under a heading that folds them away."""
    state = " open" if opened else ""
    body = "\n".join(parts)
    return f"<details{state}><summary>{heading(title)}</summary>\n{body}\n</details>"


def data_block(name: str, value: Any) -> str:
    """A script element that is data: JSON in which no character can end the element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return f'<script type="application/json" id="{escaped(name)}">{text}</script>'


def _kind(cells: Iterable[str]) -> str:
    """The attribute of the cells of a column, which may be one of numbers."""
    known = [cell for cell in cells if cell not in _NO_NUMBERS]
    numbers = bool(known) and all(_NUMBER.match(cell) for cell in known)
    return ' class="number"' if numbers else ""


def _row(cells: Sequence[str], kinds: Sequence[str], headed: bool) -> str:
    shown = [f"<td{kind}>{escaped(c)}</td>" for c, kind in zip(cells, kinds, strict=True)]
    if headed:
        shown[0] = f'<th scope="row">{escaped(cells[0])}</th>'
    return f"<tr>{''.join(shown)}</tr>"
