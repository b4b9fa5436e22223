"""Parts of HTML, for pages and for objects that show themselves in a notebook.

All text in them is escaped.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence

from mopro.text import visible

# Rows of a table and lines of a listing in a notebook.
MOST_ROWS, MOST_LINES = 12, 40
_NUMBER = re.compile(r"[-+−]?\d|at most ")
# What stands in a column of numbers where there is none.
_NO_NUMBERS = ("", "–", "unknown", "nothing to hold out")


def escaped(text: object) -> str:
    """`text` for the inside of an element or of a quoted attribute."""
    return html.escape(visible(str(text)))


def fragment(title: str, parts: Iterable[str]) -> str:
    """A heading in bold type with `parts` of HTML below it."""
    return f"<div><strong>{escaped(title)}</strong>{''.join(parts)}</div>"


def heading(text: str, level: int = 2) -> str:
    return f"<h{level}>{escaped(text)}</h{level}>"


def paragraph(text: str) -> str:
    return f"<p>{escaped(text)}</p>"


def listing(text: str, most: int | None = None) -> str:
    """Preformatted text, such as a program or a file: all of its lines, or the first `most`."""
    lines = text.splitlines()
    more = 0 if most is None else len(lines) - most
    if more <= 0:
        return f"<pre>{escaped(text)}</pre>"
    return f"<pre>{escaped(chr(10).join(lines[:most]))}\n… and {more} more lines</pre>"


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    caption: str = "",
    most: int | None = None,
) -> str:
    """A table of all rows, or of the first `most` and the number of the others.

    Without `columns` the first cell of each row is its head. Columns of numbers have the class
    `number`.
    """
    body = [[str(cell) for cell in row] for row in rows]
    kinds = [_kind(cells) if columns else "" for cells in zip(*body, strict=True)]
    head = _head(columns, kinds or [""] * len(columns)) if columns else ""
    shown = "\n".join(_row(cells, kinds, headed=not columns) for cells in body[:most])
    more = 0 if most is None else len(body) - most
    rest = f"<p>… and {more} more</p>" if more > 0 else ""
    title = f"<caption>{escaped(caption)}</caption>\n" if caption else ""
    return f'<div class="table"><table>\n{title}{head}<tbody>{shown}</tbody></table>\n{rest}</div>'


def section(title: str, parts: Iterable[str], opened: bool = True) -> str:
    """Parts of a page under a heading that folds them away."""
    state = " open" if opened else ""
    body = "\n".join(parts)
    return f"<details{state}><summary>{heading(title)}</summary>\n{body}\n</details>"


def _kind(cells: Iterable[str]) -> str:
    """The attribute of the cells of a column, which may be one of numbers."""
    known = [cell for cell in cells if cell not in _NO_NUMBERS]
    numbers = bool(known) and all(_NUMBER.match(cell) for cell in known)
    return ' class="number"' if numbers else ""


def _head(columns: Sequence[str], kinds: Sequence[str]) -> str:
    cells = zip(columns, kinds, strict=True)
    heads = "".join(f'<th scope="col"{kind}>{escaped(column)}</th>' for column, kind in cells)
    return f"<thead><tr>{heads}</tr></thead>"


def _row(cells: Sequence[str], kinds: Sequence[str], headed: bool) -> str:
    shown = [f"<td{kind}>{escaped(c)}</td>" for c, kind in zip(cells, kinds, strict=True)]
    if headed:
        shown[0] = f'<th scope="row">{escaped(cells[0])}</th>'
    return f"<tr>{''.join(shown)}</tr>"
