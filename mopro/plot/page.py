"""Building blocks of self-contained HTML pages without scripts."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from mopro.plot.figure import figure_bytes
from mopro.text import visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; }}
table {{ border-collapse: collapse; margin: 1rem 0; }}
caption {{ text-align: left; font-weight: 600; padding: .2rem 0; }}
td, th {{ padding: .2rem .7rem; text-align: right; border-bottom: 1px solid #ddd; }}
th:first-child, td:first-child {{ text-align: left; }}
figure {{ margin: 1rem 0; }}
img {{ max-width: 100%; }}
pre {{ overflow-x: auto; background: #f6f6f6; padding: .6rem; }}
</style>
<h1>{title}</h1>
{body}
</html>
"""


def _text(text: str) -> str:
    return html.escape(visible(text))


def page(title: str, parts: Iterable[str]) -> str:
    """A whole page: `title` as text, `parts` as HTML."""
    return _PAGE.format(title=_text(title), body="\n".join(parts))


def heading(text: str, level: int = 2) -> str:
    return f"<h{level}>{_text(text)}</h{level}>"


def paragraph(text: str) -> str:
    return f"<p>{_text(text)}</p>"


def listing(text: str) -> str:
    """Preformatted text, such as a program or a file."""
    return f"<pre>{_text(text)}</pre>"


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a caption; without `columns` the first cell of each row is its head."""
    lines = [f"<table>\n<caption>{_text(caption)}</caption>"]
    if columns:
        heads = "".join(f'<th scope="col">{_text(c)}</th>' for c in columns)
        lines.append(f"<tr>{heads}</tr>")
    lines += [_row(cells, headed=not columns) for cells in rows]
    return "\n".join([*lines, "</table>"])


def picture(figure: Figure, alt: str, dpi: int = 110) -> str:
    """A figure as a PNG within the page; `alt` describes it."""
    data = base64.b64encode(figure_bytes(figure, "png", dpi)).decode()
    source = f"data:image/png;base64,{data}"
    return f'<figure><img alt="{_text(alt)}" src="{source}"></figure>'


def _row(cells: Sequence[str], headed: bool) -> str:
    first, *others = (_text(cell) for cell in cells)
    head = f'<th scope="row">{first}</th>' if headed else f"<td>{first}</td>"
    return f"<tr>{head}{''.join(f'<td>{cell}</td>' for cell in others)}</tr>"
