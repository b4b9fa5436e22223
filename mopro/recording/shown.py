"""A figure that a notebook shows as a picture, whatever backend and style it has chosen."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure

from mopro.recording.style import library_style


class ShownFigure(Figure):
    """A matplotlib figure outside of pyplot: kept by nobody else, drawn when it is shown."""

    @library_style()
    def draw(self, renderer: Any) -> None:
        super().draw(renderer)

    @library_style()
    def savefig(self, *args: Any, **named: Any) -> None:
        super().savefig(*args, **named)

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=80)
        return image.getvalue()
