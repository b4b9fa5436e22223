"""Edits of a TOML text that leave all else as it is: comments, order, ways of writing."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile

from mopro.source import Source
from mopro.tomlfile import scan


@dataclass(frozen=True)
class _Line:
    """A line, and the path of what it states or is a part of; of its section if it is a comment.

    `ends`: the column behind each key that begins in it, by path.
    """

    text: str
    path: scan.Path
    ends: Mapping[scan.Path, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Text:
    """A TOML text, edited by the paths of its keys and sections, such as ("base", "mass")."""

    lines: tuple[_Line, ...]

    @classmethod
    def of(cls, source: Source) -> Text:
        """The text of a file that was read."""
        return cls(tuple(_lines(source)))

    def without(self, *path: str | int) -> Text:
        """The text without what stands at `path` and below it."""
        return Text(tuple(line for line in self.lines if line.path[: len(path)] != path))

    def with_value(self, path: scan.Path, value: str) -> Text:
        """The text with `value`, TOML in one line, for the key at `path`, in its place.

        The text as it is where no key is there, such as for a section of that name.
        """
        if not any(path in line.ends for line in self.lines):
            return self
        kept = list[_Line]()
        for line in self.lines:
            if line.path[: len(path)] != path:
                kept.append(line)
            elif path in line.ends:
                kept.append(_Line(f"{line.text[: line.ends[path] - 1]} = {value}", path))
        return Text(tuple(kept))

    def __contains__(self, path: object) -> bool:
        """True if the text states the key at `path`."""
        return any(path in line.ends for line in self.lines)

    def __str__(self) -> str:
        """The lines, without blank ones at the end."""
        return "\n".join(line.text for line in self.lines).rstrip("\n")


def _lines(source: Source) -> Iterator[_Line]:
    begun: dict[int, dict[scan.Path, int]] = {}
    for path, span in scan.places(source.text).items():
        begun.setdefault(span.line, {})[path] = span.end_column
    sections = scan.sections(source.text)
    section: scan.Path = ()
    path = section
    for number, text in enumerate(source.lines, start=1):
        if number in sections:
            section = path = sections[number]
            yield _Line(text, path)
        elif number in begun:
            path = _stated(begun[number])
            yield _Line(text, path, begun[number])
        else:
            is_comment = not text.strip() or text.lstrip().startswith("#")
            yield _Line(text, section if is_comment else path)


def _stated(paths: Iterable[scan.Path]) -> scan.Path:
    """The path that a line states, of all that begin in it: those of an inline table are below it.

    A dotted key begins its tables as well.
    """
    every = list(paths)
    deepest = [own for own in every if not any(own != p and own == p[: len(own)] for p in every)]
    shared = takewhile(lambda parts: len(set(parts)) == 1, zip(*deepest, strict=False))
    return tuple(parts[0] for parts in shared)


def quoted(text: str) -> str:
    """`text` as a TOML string: that of JSON without DEL and unpaired surrogates."""
    shown = text.encode("utf-8", "replace").decode().replace("\x7f", " ")
    return json.dumps(shown, ensure_ascii=False)
