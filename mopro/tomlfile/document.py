"""TOML files taken apart value by value; every finding is kept, at its place.

The cost grows linearly with the file: it is read once, its places are noted in one pass,
and a finding's place is looked up.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from mopro.errors import MOST_SHOWN, Diagnostic, ModelError
from mopro.inputs import open_to_read
from mopro.source import Source, Span
from mopro.tomlfile import scan
from mopro.tomlfile.shown import shown

MOST_BYTES = 1 << 20
_TOML_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")
_TOP = Span(1, 1, 1)

T = TypeVar("T")
D = TypeVar("D")


class Refused(Exception):
    """A value that cannot be used; the reason is among the document's findings already."""


class Unreadable(Exception):
    """The reason why there is no text, for the caller to tell in his words."""


class Document:
    """A parsed TOML text, the place of each key, and what was found so far."""

    def __init__(self, source: Source) -> None:
        """Raises ModelError: `bad-toml` at the fault, `too-large` beyond the limits."""
        self.source = source
        self.found: list[Diagnostic] = []
        self._suggestions = 0
        try:
            self._places = scan.places(source.text)
        except scan.BeyondLimit as error:
            raise ModelError(source, [Diagnostic("too-large", str(error), error.span)]) from error
        self.root = Value(self, (), _parsed(source))

    def place(self, path: scan.Path) -> Span:
        """Span of `path`, else of the table that contains it, else the beginning of the file."""
        while path:
            if span := self._places.get(path):
                return span
            path = path[:-1]
        return _TOP

    def read(self, read: Callable[[Value], T]) -> T:
        """The file as `read` reads it; ModelError with all findings if there are any."""
        try:
            result = read(self.root)
        except Refused as error:
            raise ModelError(self.source, self.found) from error
        if self.found:
            raise ModelError(self.source, self.found)
        return result

    def suggestion(self, key: str, names: Iterable[str]) -> str | None:
        """The name that `key` resembles.

        None after as many as a report shows: to compare names takes long.
        """
        from difflib import get_close_matches

        self._suggestions += 1
        if self._suggestions > MOST_SHOWN:
            return None
        near = get_close_matches(key, names, n=1)
        return near[0] if near else None


class Value:
    """One value of a file: its data, and where it stands."""

    __slots__ = ("_document", "_path", "data")

    def __init__(self, document: Document, path: scan.Path, data: Any) -> None:
        self._document = document
        self._path = path
        self.data = data

    @property
    def key(self) -> str:
        """The key that the value has in its table."""
        return shown(next((part for part in reversed(self._path) if isinstance(part, str)), ""))

    @property
    def name(self) -> str:
        """The name of a section, with all that it is in: `effects.NAME`."""
        return ".".join(shown(part) for part in self._path if isinstance(part, str))

    @property
    def span(self) -> Span:
        return self._document.place(self._path)

    @property
    def faults(self) -> int:
        """Number of findings in the whole file so far."""
        return len(self._document.found)

    def report(
        self,
        message: str,
        rule: str = "bad-value",
        hint: str | None = None,
        at: str | None = None,
    ) -> None:
        """Note a finding about this value, or about key `at` of this table."""
        path = self._path if at is None else (*self._path, at)
        finding = Diagnostic(rule, message, self._document.place(path), hint=hint)
        self._document.found.append(finding)

    def refused(self, message: str, rule: str = "bad-value", hint: str | None = None) -> Refused:
        """Note a finding, and give the exception to raise."""
        self.report(message, rule, hint)
        return Refused()

    def error_inside(self, message: str, start: int, end: int, rule: str) -> ModelError:
        """The error of a finding about the characters `start` to `end` (from 0) of this string.

        It is placed at the key where the line does not hold the string as it is.
        """
        span, text, source = self.span, str(self.data), self._document.source
        at = source.line(span.line).find(text, span.column - 1)
        if at >= 0:
            span = Span(span.line, at + start + 1, at + max(end, start + 1) + 1)
        return ModelError(source, [Diagnostic(rule, message, span)])

    def error(self, message: str, rule: str = "bad-value", hint: str | None = None) -> ModelError:
        """The error of a finding about this value, for whoever has read the file already."""
        return ModelError(self._document.source, [Diagnostic(rule, message, self.span, hint=hint)])

    def include(self, error: ModelError) -> Refused:
        """Note the findings of `error`, which are of this file, and give the exception to raise."""
        self._document.found.extend(error.diagnostics)
        return Refused()

    # -- tables ----------------------------------------------------------------

    def over(self, base: Mapping[str, Any]) -> Value:
        """This table with what `base` has beside it, section by section.

        A key of a section that both state is this table's. What `base` alone states has the
        place of the section around it, or the beginning of the file.
        """
        merged = dict(base)
        for key, own in self.data.items():
            below = base.get(key)
            both = isinstance(own, dict) and isinstance(below, dict)
            merged[key] = {**below, **own} if both and below is not None else own
        return Value(self._document, self._path, merged)

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def __getitem__(self, key: str) -> Value:
        return Value(self._document, (*self._path, key), self.data[key])

    def values(self) -> Iterator[Value]:
        """The values of this table, in the order of the file."""
        return (self[key] for key in self.data)

    def only(self, known: Iterable[str]) -> None:
        """Note every key of this table that is not among those known."""
        names = sorted(known)
        unknown = self.data.keys() - set(names)
        for key in self.data if unknown else ():
            if key in unknown:
                near = self._document.suggestion(key, names)
                hint = f"did you mean `{near}`?" if near else f"known are {', '.join(names)}"
                self.report(f"unknown key {shown(key)}", "unknown-key", hint, at=key)

    def get(self, key: str, read: Callable[[Value], T], default: D) -> T | D:
        """Key `key` of this table as `read` reads it; `default` without it or if refused."""
        try:
            return read(self[key]) if key in self.data else default
        except Refused:
            return default

    def need(
        self, key: str, read: Callable[[Value], T], missing: str, rule: str = "missing-key"
    ) -> T | None:
        """Key `key` as `read` reads it; None after a finding, `missing` if it is not there."""
        if key not in self.data:
            self.report(missing, rule)
        return self.get(key, read, None)

    def sections(self, key: str) -> list[Value]:
        """All sections `[[key]]`; none, after a finding, if it is anything else."""
        entries = self.data.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            self.report(f"expected entries under [[{key}]]", at=key)
            return []
        path = (*self._path, key)
        return [Value(self._document, (*path, n), entry) for n, entry in enumerate(entries)]


def read_source(path: str | Path) -> Source:
    """The text of file `path`; ModelError `unreadable`, or `too-large`, if there is none."""
    try:
        return Source(str(path), read_text(path))
    except Unreadable as error:
        finding = Diagnostic("unreadable", f"cannot be read: {error}", _TOP)
        raise ModelError(Source(str(path), ""), [finding]) from error


def read_named(kind: str, name_or_path: str, builtins: Iterable[str]) -> Source:
    """The text of a file that is no built-in `kind`; ModelError if it cannot be read."""
    try:
        return Source(name_or_path, read_text(name_or_path))
    except Unreadable as error:
        message = f"no {kind} has this name, and as a file it cannot be read: {error}"
        hint = f"built in: {', '.join(builtins)}"
        finding = Diagnostic(f"unknown-{kind}", message, _TOP, hint=hint)
        raise ModelError(Source(name_or_path, ""), [finding]) from error


def read_text(path: str | Path) -> str:
    """The text of a file, each line end as a line feed; Unreadable if there is none.

    Raises ModelError `too-large` if it has more than `MOST_BYTES`; no more are read.
    """
    try:
        with open_to_read(path, stream=True) as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise Unreadable(error.strerror) from error
    except ValueError as error:  # a zero byte in the name
        raise Unreadable("no file has such a name") from error
    if len(data) > MOST_BYTES:
        message = f"the file has more than {MOST_BYTES} bytes, which is the most for TOML"
        raise ModelError(Source(str(path), ""), [Diagnostic("too-large", message, _TOP)])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise Unreadable(f"it is not UTF-8 text (line {line})") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _parsed(source: Source) -> dict[str, Any]:
    try:
        return tomllib.loads(source.text)
    except tomllib.TOMLDecodeError as error:
        place = _TOML_PLACE.search(str(error))
        line, column = (int(place[1]), int(place[2])) if place else (len(source.lines), 1)
        message = _TOML_PLACE.sub("", str(error)).strip()
        finding = Diagnostic("bad-toml", shown(message, 200), Span(line, column, column + 1))
        raise ModelError(source, [finding]) from error
