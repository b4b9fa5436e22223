"""Renders a figure to bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_bytes(figure: Figure, form: str, dpi: int | None = None) -> bytes:
    """The figure as a file of the format `form`: png, svg or pdf."""
    image = io.BytesIO()
    figure.savefig(image, format=form, dpi=dpi or "figure")
    return image.getvalue()
