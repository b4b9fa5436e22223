"""Text of a file in a message."""

from __future__ import annotations

from mopro.text import visible


def shown(value: object, width: int = 60) -> str:
    """`value` as text of at most `width` characters; what cannot be printed is escaped."""
    text = str(value)
    cut = text if len(text) <= width else text[: width - 1] + "…"
    return visible(cut).replace("\n", r"\n").replace("\t", r"\t")
