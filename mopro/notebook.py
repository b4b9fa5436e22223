"""Parts of HTML by which objects show themselves in a notebook; all text in them is escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from mopro.text import visible

# Rows of a table and lines of a listing that are shown; how many more there are is told.
MOST_ROWS = 12
_MOST_LINES = 40


def _text(text: object) -> str:
    return html.escape(visible(str(text)))


def fragment(title: str, parts: Iterable[str]) -> str:
    """A heading in bold type with `parts` of HTML below it."""
    return f"<div><strong>{_text(title)}</strong>{''.join(parts)}</div>"


def paragraph(text: str) -> str:
    return f"<p>{_text(text)}</p>"


def listing(text: str) -> str:
    """The first lines of `text` as they stand."""
    lines = text.splitlines()
    more = len(lines) - _MOST_LINES
    rest = f"\n… and {more} more lines" if more > 0 else ""
    return f"<pre>{_text(chr(10).join(lines[:_MOST_LINES]))}{rest}</pre>"


def table(
    columns: Sequence[str], rows: Iterable[Sequence[object]], most: int | None = MOST_ROWS
) -> str:
    """A table of the first `most` rows, or of all."""
    cells = [[f"<td>{_text(cell)}</td>" for cell in row] for row in rows]
    heads = "".join(f"<th>{_text(column)}</th>" for column in columns)
    body = "".join(f"<tr>{''.join(row)}</tr>" for row in cells[:most])
    more = 0 if most is None else len(cells) - most
    rest = f"<p>… and {more} more</p>" if more > 0 else ""
    head = f"<thead><tr>{heads}</tr></thead>" if heads else ""
    return f"<table>{head}<tbody>{body}</tbody></table>{rest}"
