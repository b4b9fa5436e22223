"""A figure that a notebook shows as a picture, whatever backend and style it has chosen."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.text import Text

from mopro.recording.style import library_style
from mopro.text import escaped


class ShownFigure(Figure):
    """A matplotlib figure outside of pyplot: kept by nobody else, drawn when it is shown."""

    @library_style()
    def draw(self, renderer: Any) -> None:
        super().draw(renderer)

    @library_style()
    def savefig(self, *args: Any, **named: Any) -> None:
        super().savefig(*args, **named)

    def _repr_png_(self) -> bytes:
        return figure_bytes(self, "png", dpi=80)


def figure_bytes(figure: Figure, form: str, dpi: int | None = None) -> bytes:
    r"""The figure as a file of the format `form`: png, svg or pdf.

    A character that the font lacks is written as an escape, such as `\u4e2d`.
    """
    _escape_unknown(figure)
    image = io.BytesIO()
    figure.savefig(image, format=form, dpi=dpi or "figure")
    return image.getvalue()


def _escape_unknown(figure: Figure) -> None:
    """Write what a font cannot draw, which is shown as boxes, so that it can be read."""
    for own in figure.findobj(Text):
        assert isinstance(own, Text)
        text = own.get_text()
        if not text.isascii():
            known = get_font(findfont(own.get_fontproperties())).get_charmap()
            own.set_text("".join(c if c == "\n" or ord(c) in known else escaped(c) for c in text))
