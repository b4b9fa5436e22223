"""Escaping of text from outside: names, cells and replies that mopro did not write."""

from __future__ import annotations


def plain(text: str) -> str:
    """`text` for a title, a label or a legend: shown as it stands, never read as mathematics.

    For all that comes from outside (names of programs, machines, sensors, data). Characters
    that no font has are shown as `\N{REPLACEMENT CHARACTER}`.
    """
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return shown.replace("$", r"\$")
