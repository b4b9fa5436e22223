"""A figure that a notebook shows as a picture, whatever backend it has chosen."""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A matplotlib figure outside of pyplot: kept by nobody else, drawn when it is shown."""

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=80)
        return image.getvalue()
