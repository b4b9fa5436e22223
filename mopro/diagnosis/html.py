"""Parts of HTML by which a verdict shows itself in a notebook; all text in them is escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


def _text(text: str) -> str:
    """`text` escaped; what is not printable as an escape."""
    seen = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return html.escape("".join(seen))


def paragraph(text: str) -> str:
    return f"<p>{_text(text)}</p>"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a head."""
    heads = "".join(f"<th>{_text(column)}</th>" for column in columns)
    body = "".join(f"<tr>{''.join(f'<td>{_text(c)}</td>' for c in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
