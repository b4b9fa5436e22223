"""HTML of a verdict in a notebook: headings, paragraphs and tables, all text in them escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


def section(title: str, parts: Iterable[str]) -> str:
    """A heading in bold type with `parts` of HTML below it."""
    return f"<div><strong>{_escaped(title)}</strong>{''.join(parts)}</div>"


def paragraph(text: str) -> str:
    return f"<p>{_escaped(text)}</p>"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{_escaped(column)}</th>" for column in columns)
    body = ("".join(f"<td>{_escaped(cell)}</td>" for cell in row) for row in rows)
    lines = "".join(f"<tr>{cells}</tr>" for cells in body)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"


def _escaped(text: str) -> str:
    """`text` for the inside of an element; characters that do not print as an escape."""
    printed = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return html.escape("".join(printed))
