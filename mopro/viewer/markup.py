"""Building blocks of pages: all text is escaped."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from typing import Any

from mopro.text import visible


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
    """A table with a caption; without `columns` the first cell of each row is its head."""
    lines = [f'<div class="table"><table>\n<caption>{escaped(caption)}</caption>']
    if columns:
        heads = "".join(f'<th scope="col">{escaped(c)}</th>' for c in columns)
        lines.append(f"<tr>{heads}</tr>")
    lines += [_row(cells, headed=not columns) for cells in rows]
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


def _row(cells: Sequence[str], headed: bool) -> str:
    first, *others = (escaped(cell) for cell in cells)
    head = f'<th scope="row">{first}</th>' if headed else f"<td>{first}</td>"
    return f"<tr>{head}{''.join(f'<td>{cell}</td>' for cell in others)}</tr>"
