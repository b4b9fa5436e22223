"""Renders a figure to bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from mopro.recording.shown import escape_unknown

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_bytes(figure: Figure, form: str, dpi: int | None = None) -> bytes:
    r"""The figure as a file of the format `form`: png, svg or pdf.

    A character that the font lacks is written as an escape, such as `\u4e2d`.
    """
    escape_unknown(figure)
    image = io.BytesIO()
    figure.savefig(image, format=form, dpi=dpi or "figure")
    return image.getvalue()
