"""Scripts and styles of the viewer, as they are in the package."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

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
