"""Escaping of text from outside (names, cells, replies); names of classes in data."""

from __future__ import annotations


def visible(text: str) -> str:
    """`text` with all that is not shown as itself written as an escape, such as `\\x1b`.

    That is: control characters but tab and line feed, characters that change the direction
    of text, invisible ones, halves of surrogate pairs.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else escaped(c) for c in text)


def escaped(character: str) -> str:
    r"""The character as an escape, such as `\x1b`."""
    return character.encode("unicode_escape").decode("ascii")


def plain(text: str) -> str:
    """`text` for a title, a label or a legend: shown as it stands, never read as mathematics.

    For all that comes from outside (names of programs, machines, sensors, data).
    """
    return visible(text).replace("$", r"\$")


def snake_case(name: str) -> str:
    """The name of a class, `SetVelocity`, in the form for data: `set_velocity`."""
    return name[0].lower() + "".join(f"_{c.lower()}" if c.isupper() else c for c in name[1:])
