"""The place of every key of a TOML text, found in one pass from its beginning to its end.

The standard parser keeps no places, and spends memory without bound on deep nesting and
long dotted keys. So this pass comes first: it notes places and refuses what goes beyond
the limits. It does not judge syntax. Up to the first fault of a text it sees the tokens
that the parser sees; what it makes of the rest does not matter, as the parser refuses the
text at that fault.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from dataclasses import dataclass

from mopro.source import Span

# From the top of the file to a value: keys and list indices, such as ("run", 0, "data").
Path = tuple[str | int, ...]

MOST_LEVELS = 32
_TOO_DEEP = f"nested more than {MOST_LEVELS} levels deep"
_LONGEST_INTEGER = 200  # characters; 64 bits in binary, each digit with an underscore, have fewer
_INT64 = 1 << 63

# Possessive (`++`, `*+`) and atomic (`(?>`): what has been taken is not tried again, so that
# an unterminated string costs one pass. A group is atomic, since Python before 3.11.5 does
# not match some possessive groups (gh-106052). `"""` never begins an ordinary string.
_STRING = r"""
      "{3} (?> (?: [^"\\]++ | \\. | ""?(?!") )* ) "{3,5}
    | '{3} (?> (?: [^']++ | ''?(?!') )* ) '{3,5}
    | " (?!"") (?> (?: [^"\\\n]++ | \\. )* ) "
    | ' (?!'') [^'\n]*+ '
"""
_TOKEN = r"""
      [ \t\r]++ | \#[^\n]*+
    | (?P<newline> \n )
    | (?P<string> {string} )
    | (?P<mark> [][{{}},{marks}] )
    | (?P<word> [^][{{}},{marks}\#"'\ \t\r\n]++ )
"""
_IN_KEY = re.compile(_TOKEN.format(string=_STRING, marks="=."), re.VERBOSE | re.DOTALL)
_IN_VALUE = re.compile(_TOKEN.format(string=_STRING, marks="="), re.VERBOSE | re.DOTALL)
_INTEGER = re.compile(r"[+-]?(?:0x[0-9A-Fa-f_]+|0o[0-7_]+|0b[01_]+|[0-9_]+)")


class BeyondLimit(ValueError):
    """Something nested too deeply, or an integer of more than 64 bits, at `span`."""

    def __init__(self, message: str, span: Span) -> None:
        super().__init__(message)
        self.span = span


def places(text: str) -> dict[Path, Span]:
    """The place of each key and section of `text`, and of each table and list in a list.

    A key's place is its last part (`pitch` of `axis.pitch = ...`), a section's place all
    that stands between the brackets, that of an element of a list its opening bracket.
    Raises BeyondLimit.
    """
    return _Scan(text).run()


def sections(text: str) -> dict[int, Path]:
    """The path of each `[name]` and `[[name]]` of `text`, by the number of its line.

    Raises BeyondLimit.
    """
    scan = _Scan(text)
    scan.run()
    return scan.sections


@dataclass(slots=True)
class _Open:
    """A bracket that is not closed yet; `count` is the index of a list's element."""

    path: Path
    is_list: bool
    count: int = 0


class _Scan:
    """One pass over a text.

    Either a key is read (`_parts` are those seen so far) or a value (that of `_path`,
    unless it is a list's element).
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._places: dict[Path, Span] = {}
        self._line, self._line_start = 1, 0
        self._in_value = False
        self._header = 0  # how many brackets opened the header that is being read
        self._section: Path = ()
        self.sections: dict[int, Path] = {}
        self._tables_of: Counter[Path] = Counter()  # how many [[name]] there were
        self._parts: list[tuple[str, Span]] = []
        self._path: Path = ()
        self._open: list[_Open] = []

    def run(self) -> dict[Path, Span]:
        take = {
            "newline": self._newline,
            "string": self._string,
            "word": self._word,
            "mark": self._mark,
        }
        position = 0
        while match := (_IN_VALUE if self._in_value else _IN_KEY).match(self._text, position):
            if match.lastgroup:
                take[match.lastgroup](match)
            position = match.end()
        return self._places

    def _span(self, match: re.Match[str]) -> Span:
        start = match.start() - self._line_start + 1
        return Span(self._line, start, start + len(match[0]))

    # -- tokens ----------------------------------------------------------------

    def _newline(self, match: re.Match[str]) -> None:
        self._line, self._line_start = self._line + 1, match.end()
        if not self._open:
            self._in_value, self._header = False, 0
            self._parts.clear()

    def _string(self, match: re.Match[str]) -> None:
        token = match[0]
        if not self._in_value:
            self._parts.append((_unquoted(token), self._span(match)))
        if lines := token.count("\n"):
            self._line += lines
            self._line_start = match.start() + token.rindex("\n") + 1

    def _word(self, match: re.Match[str]) -> None:
        if not self._in_value:
            self._parts.append((match[0], self._span(match)))
        elif _INTEGER.fullmatch(match[0]) and not _fits(match[0]):
            message = "an integer of more than 64 bits: write a large number as 1e30"
            raise BeyondLimit(message, self._span(match))

    def _mark(self, match: re.Match[str]) -> None:
        mark = match[0]
        if mark in "]}" and not self._header:
            self._close()
        elif self._in_value:
            self._mark_in_value(mark, match)
        elif mark == "=":
            self._key()
        elif mark == "[":
            self._header += 1
        elif mark == "]":
            self._begin_section()

    def _mark_in_value(self, mark: str, match: re.Match[str]) -> None:
        if mark in "[{":
            path = self._bracketed(match)
            self._open.append(_Open(path, is_list=mark == "["))
            self._in_value = mark == "["
        elif mark == "," and self._open:
            self._open[-1].count += 1
            self._in_value = self._open[-1].is_list
            self._parts.clear()

    def _close(self) -> None:
        """After a bracket a comma, another bracket or the line's end follows, as after a value."""
        if self._open:
            self._open.pop()
            self._in_value = True
            self._parts.clear()

    # -- places ----------------------------------------------------------------

    def _key(self) -> None:
        """The key before an equals sign; its value follows."""
        path = self._open[-1].path if self._open else self._section
        self._check_levels(len(path))
        for name, span in self._parts:
            path = (*path, name)
            self._places.setdefault(path, span)
        self._path, self._in_value = path, True
        self._parts.clear()

    def _begin_section(self) -> None:
        """`[name]` or `[[name]]`; a part that names a list means its last element."""
        self._check_levels(0)
        path: Path = ()
        for name, span in self._parts:
            if path in self._tables_of:
                path = (*path, self._tables_of[path] - 1)
            path = (*path, name)
            self._places.setdefault(path, span)
        if self._parts:
            first, last = self._parts[0][1], self._parts[-1][1]
            self._section = self._named(path, Span(last.line, first.column, last.end_column))
            self.sections[last.line] = self._section
        self._header = 0
        self._parts.clear()

    def _named(self, path: Path, span: Span) -> Path:
        """The path of a section's content."""
        if self._header == 1:
            self._places[path] = span
            return path
        element = (*path, self._tables_of[path])
        self._tables_of[path] += 1
        if self._tables_of[path] == 1:
            self._places[path] = span
        self._places[element] = span
        return element

    def _bracketed(self, match: re.Match[str]) -> Path:
        """The path of the list or table that begins here, noted if it is a list's element."""
        if not (self._open and self._open[-1].is_list):
            return self._path
        path = (*self._open[-1].path, self._open[-1].count)
        if len(path) > MOST_LEVELS:
            raise BeyondLimit(_TOO_DEEP, self._span(match))
        self._places[path] = self._span(match)
        return path

    def _check_levels(self, above: int) -> None:
        """Refuse a key of too many parts, at the first one too many; `above` are taken."""
        left = max(0, MOST_LEVELS - above)
        if len(self._parts) > left:
            raise BeyondLimit(_TOO_DEEP, self._parts[left][1])


def _unquoted(token: str) -> str:
    """The name that a quoted key stands for; the token itself if it is none."""
    if "\\" not in token:
        return token[1:-1]
    try:
        return str(tomllib.loads(f"key = {token}")["key"])
    except tomllib.TOMLDecodeError:
        return token


def _fits(integer: str) -> bool:
    """True if 64 bits hold the integer, or if the text is not an integer."""
    if len(integer) > _LONGEST_INTEGER:
        return False
    try:
        return -_INT64 <= int(integer, 0) < _INT64
    except ValueError:
        return True
