"""A whole page: policy, styles, scripts, data and the parts that need no script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from mopro.markup import escaped
from mopro.viewer.view import Pack, View

FOLDER = Path(__file__).parent / "static"
PLOTTER = FOLDER / "uplot"
SCRIPTS = (
    "data.js", "units.js", "state.js", "density.js", "plots.js", "program.js", "pictures.js",
    "player.js", "tables.js", "live.js", "app.js",
)  # fmt: skip


@cache
def scripts() -> tuple[str, ...]:
    """The plotting library with its licence, and the viewer's own scripts, in order."""
    licence = (PLOTTER / "LICENSE").read_text("utf-8")
    library = (PLOTTER / "uPlot.iife.min.js").read_text("utf-8")
    own = [(FOLDER / name).read_text("utf-8") for name in SCRIPTS]
    return (f"/*\n{licence}*/\n{library}", *own)


@cache
def styles() -> tuple[str, ...]:
    """The style sheets: the library's and the viewer's own."""
    sheets = (PLOTTER / "uPlot.min.css", FOLDER / "viewer.css")
    return tuple(sheet.read_text("utf-8") for sheet in sheets)


def policy(connect: str = "'none'") -> str:
    """The page's Content-Security-Policy: its own scripts and styles alone, and no network.

    `connect` are the addresses that scripts may speak to.
    """
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src {' '.join(map(_digest, scripts()))}",
            f"style-src {' '.join(map(_digest, styles()))}",
            f"connect-src {connect}",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def _digest(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="referrer" content="no-referrer">
<title>{title}</title>
{styles}
</head>
<body>
<header id="head">
<h1>{title}</h1>
{lead}
</header>
<noscript><p>The plots of this page need JavaScript; the tables below do not.</p></noscript>
<main id="viewer"></main>
<div id="sections">
{body}
</div>
{data}
{scripts}
</body>
</html>
"""


def document(
    title: str,
    lead: Iterable[str],
    views: Sequence[View],
    body: Iterable[str],
    options: dict[str, Any] | None = None,
    connect: str = "'none'",
) -> str:
    """The page of `views`; `lead` and `body` are HTML above and below them.

    `options` are told to the scripts; `connect` is for a page that is fed (`policy`).
    """
    pack = Pack()
    shown = [view.as_json(pack) for view in views]
    content = {**(options or {}), "views": shown}
    return _PAGE.format(
        policy=escaped(policy(connect)),
        title=escaped(title),
        lead="\n".join(lead),
        body="\n".join(body),
        styles="\n".join(f"<style>{sheet}</style>" for sheet in styles()),
        data=data_block("page-data", {**content, "block": pack.text()}),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts()),
    )


def data_block(name: str, value: Any) -> str:
    """A script element that is data: JSON in which no character can end the element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return f'<script type="application/json" id="{escaped(name)}">{text}</script>'
