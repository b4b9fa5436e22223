"""A figure's texts as they are meant, and its bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plain(text: str) -> str:
    """`text` for a title, a label or a legend: shown as it stands, never read as mathematics.

    For all that comes from outside (names of programs, machines, sensors, data). Characters
    that no font has are shown as `\N{REPLACEMENT CHARACTER}`.
    """
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return shown.replace("$", r"\$")


def figure_bytes(figure: Figure, form: str, dpi: int | None = None) -> bytes:
    """The figure as a file of the format `form`: png, svg or pdf."""
    image = io.BytesIO()
    figure.savefig(image, format=form, dpi=dpi or "figure")
    return image.getvalue()
