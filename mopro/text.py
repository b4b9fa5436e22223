"""Escaping of text from outside (names, cells, replies); names of classes in data."""

from __future__ import annotations


def plain(text: str) -> str:
    """`text` for a title, a label or a legend: shown as it stands, never read as mathematics.

    For all that comes from outside (names of programs, machines, sensors, data). Characters
    that no font has are shown as `\N{REPLACEMENT CHARACTER}`.
    """
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return shown.replace("$", r"\$")


def snake_case(name: str) -> str:
    """The name of a class, `SetVelocity`, in the form for data: `set_velocity`."""
    return name[0].lower() + "".join(f"_{c.lower()}" if c.isupper() else c for c in name[1:])
