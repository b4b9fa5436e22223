"""Text from outside: encoding of files, escaping of names, cells, replies; names of classes."""

from __future__ import annotations

import codecs

# The mark of UTF-32 begins with that of UTF-16.
_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
# By the bytes of a character, and by which of them tells letters: the encoding without a mark.
_WIDE = {2: {0: "utf-16-le", 1: "utf-16-be"}, 4: {0: "utf-32-le", 3: "utf-32-be"}}
# Shares of zeros in the bytes of a wide character: of the one that tells letters, of the others.
_FEW_ZEROS, _MOST_ZEROS = 0.1, 0.5


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


def wide_encoding(data: bytes) -> str | None:
    """The encoding of a text of two or four bytes a character that begins with `data`; else None.

    It has a mark, or zeros as such a text has: of letters and digits one byte is hardly ever zero,
    and the others mostly are.
    """
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            return encoding
    for width, endings in _WIDE.items():
        parts = [data[place::width] for place in range(width)]
        zeros = [part.count(0) / max(len(part), 1) for part in parts]
        letters = zeros.index(min(zeros))
        others = zeros[:letters] + zeros[letters + 1 :]
        if letters in endings and zeros[letters] < _FEW_ZEROS and min(others) > _MOST_ZEROS:
            return endings[letters]
    return None
