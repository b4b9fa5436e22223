"""TOML files whose every fault is reported at its place; the base of each such reader."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mopro.errors import Diagnostic, ModelError
from mopro.source import Source, Span

_TOML_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")
_HEADER = re.compile(r"\s*\[{1,2}\s*([^]]+?)\s*\]")


def parse_toml(source: Source) -> dict[str, Any]:
    """The data in `source`; ModelError with the place if it is no TOML."""
    try:
        return tomllib.loads(source.text)
    except tomllib.TOMLDecodeError as error:
        place = _TOML_PLACE.search(str(error))
        line, column = (int(place[1]), int(place[2])) if place else (len(source.lines), 1)
        message = _TOML_PLACE.sub("", str(error)).strip()
        finding = Diagnostic("bad-toml", message, Span(line, column, column + 1))
        raise ModelError(source, [finding]) from error


def read_named(kind: str, name_or_path: str, builtins: Iterable[str]) -> Source:
    """The text of a file that is no built-in `kind`; ModelError if it cannot be read."""
    try:
        return Source(name_or_path, Path(name_or_path).read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        message = f"no {kind} has this name, and as a file it cannot be read: {reason}"
        hint = f"built in: {', '.join(builtins)}"
        finding = Diagnostic(f"unknown-{kind}", message, Span(1, 1, 1), hint=hint)
        raise ModelError(Source(name_or_path, ""), [finding]) from error


class TomlReader:
    """Takes a file's data apart and gathers findings, each at the key it is about."""

    def __init__(self, source: Source, data: dict[str, Any]) -> None:
        self._source = source
        self._data = data
        self._found: list[Diagnostic] = []

    def _check(self) -> None:
        """Raise ModelError if anything was found."""
        if self._found:
            raise ModelError(self._source, self._found)

    def _known(
        self, section: str, table: dict[str, Any], known: Iterable[str], at: str = "", nth: int = 0
    ) -> None:
        names = set(known)
        for key in table.keys() - names:
            from difflib import get_close_matches

            near = get_close_matches(key, names, n=1)
            hint = f"did you mean `{near[0]}`?" if near else f"known are {', '.join(sorted(names))}"
            self._report("unknown-key", f"unknown key {key}", section, at or key, hint, nth)

    def _report(
        self,
        rule: str,
        message: str,
        section: str,
        key: str,
        hint: str | None = None,
        nth: int = 0,
    ) -> None:
        place = self._place(section, key, nth)
        self._found.append(Diagnostic(rule, message, place, hint=hint))

    def _place(self, section: str, key: str, nth: int = 0) -> Span:
        """Where `key` of `section` stands; else that section; else the first line.

        `nth` counts the sections of that name (`[[fault]]`) from 0.
        """
        current, seen, home = "", -1, Span(1, 1, 1)
        for number, line in enumerate(self._source.lines, start=1):
            if header := _HEADER.match(line):
                current = header[1]
                here = Span(number, header.start(1) + 1, header.end(1) + 1)
                seen += current == section
                if not section and current == key:
                    return here
                home = here if current == section and seen == nth else home
            elif current == section and (not section or seen == nth):
                match = re.match(rf"\s*({re.escape(key)})\s*=", line)
                if match:
                    return Span(number, match.start(1) + 1, match.end(1) + 1)
        return home
