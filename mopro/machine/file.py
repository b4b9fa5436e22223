"""Machine files: TOML in which each value states its unit and where it comes from."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import Field, fields
from difflib import get_close_matches
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from mopro.errors import Diagnostic, ModelError
from mopro.machine.model import Axis, Drive, Heat, Machine, Platen, Provenance
from mopro.source import Source, Span
from mopro.units import to_si

ORIGINS = ("thesis", "derived", "assumed", "measured")
_SECTIONS: dict[str, type[Any]] = {"axis": Axis, "drive": Drive, "platen": Platen, "heat": Heat}
_VALUE_KEYS = {"value", "unit", "origin", "place"}
_TOML_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")


def builtin_machines() -> list[str]:
    """The names that `load_machine` knows without a file."""
    folder = resources.files("mopro.machine") / "machines"
    return sorted(
        p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml")
    )


@cache
def _builtin(name: str) -> Machine:
    file = resources.files("mopro.machine") / "machines" / f"{name}.toml"
    return read_machine(Source(f"{name}.toml", file.read_text("utf-8")))


def load_machine(name_or_path: str) -> Machine:
    """The built-in machine of that name, or the one in that file; else ModelError."""
    if name_or_path in builtin_machines():
        return _builtin(name_or_path)
    try:
        text = Path(name_or_path).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        message = f"no machine has this name, and as a file it cannot be read: {reason}"
        hint = f"built in: {', '.join(builtin_machines())}"
        finding = Diagnostic("unknown-machine", message, Span(1, 1, 1), hint=hint)
        raise ModelError(Source(name_or_path, ""), [finding]) from error
    return read_machine(Source(name_or_path, text))


def read_machine(source: Source) -> Machine:
    """The machine that `source` describes; ModelError with all findings, by line."""
    try:
        data = tomllib.loads(source.text)
    except tomllib.TOMLDecodeError as error:
        place = _TOML_PLACE.search(str(error))
        line, column = (int(place[1]), int(place[2])) if place else (len(source.lines), 1)
        message = _TOML_PLACE.sub("", str(error)).strip()
        finding = Diagnostic("bad-toml", message, Span(line, column, column + 1))
        raise ModelError(source, [finding]) from error
    return _Reader(source, data).machine()


class _Reader:
    """Takes a machine file's data apart and gathers findings."""

    def __init__(self, source: Source, data: dict[str, Any]) -> None:
        self._source = source
        self._data = data
        self._found: list[Diagnostic] = []
        self._provenance: dict[str, Provenance] = {}

    def machine(self) -> Machine:
        self._known("", self._data, {"name", *_SECTIONS})
        name = self._data.get("name")
        if not isinstance(name, str) or not name:
            self._report("missing-key", 'expected a name, such as name = "mine"', "", "name")
        parts = {key: self._section(key, kind) for key, kind in _SECTIONS.items()}
        if self._found:
            raise ModelError(self._source, self._found)
        return Machine(name=str(name), provenance=self._provenance, **parts)

    def _section(self, section: str, kind: type[Any]) -> Any:
        table = self._data.get(section)
        if not isinstance(table, dict):
            self._report("missing-key", f"expected a section [{section}]", "", section)
            return None
        quantities = fields(kind)
        self._known(section, table, {f.metadata["key"] for f in quantities})
        values = {f.name: self._value(section, table, f) for f in quantities}
        return None if None in values.values() else kind(**values)

    def _value(self, section: str, table: dict[str, Any], quantity: Field[Any]) -> float | None:
        key, dimension = quantity.metadata["key"], quantity.metadata["dimension"]
        if key not in table:
            self._report("missing-key", f"[{section}] has no {key}", "", section)
            return None
        entry = table[key]
        number = entry.get("value") if isinstance(entry, dict) else None
        if not isinstance(entry, dict) or isinstance(number, bool):
            number = None
        if not isinstance(number, int | float) or not math.isfinite(number):
            message = (
                f"expected {key} = {{ value = number, unit = ..., origin = ..., place = ... }}"
            )
            self._report("bad-value", message, section, key)
            return None
        self._known(section, entry, _VALUE_KEYS, at=key)
        if entry.get("origin") not in ORIGINS:
            message = f"expected an origin of {key}: one of {', '.join(ORIGINS)}"
            self._report("missing-origin", message, section, key)
        self._provenance[f"{section}.{key}"] = Provenance(
            str(entry.get("origin")), str(entry.get("place", ""))
        )
        try:
            value = to_si(number, str(entry.get("unit")), dimension)
        except ValueError as error:
            self._report("wrong-unit", f"{key}: {error}", section, key)
            return None
        low, above = quantity.metadata["at_least"], quantity.metadata["above"]
        if value < low or (above and value == low):
            message = f"{key} must be {'greater than' if above else 'at least'} {low:g}"
            self._report("bad-value", message, section, key)
            return None
        return value

    def _known(self, section: str, table: dict[str, Any], known: set[str], at: str = "") -> None:
        for key in table.keys() - known:
            near = get_close_matches(key, known, n=1)
            hint = f"did you mean `{near[0]}`?" if near else f"known are {', '.join(sorted(known))}"
            self._report("unknown-key", f"unknown key {key}", section, at or key, hint)

    def _report(
        self, rule: str, message: str, section: str, key: str, hint: str | None = None
    ) -> None:
        self._found.append(Diagnostic(rule, message, self._place(section, key), hint=hint))

    def _place(self, section: str, key: str) -> Span:
        """Where `key` of `section` stands; the first line if it stands nowhere."""
        current = ""
        for number, line in enumerate(self._source.lines, start=1):
            if header := re.match(r"\s*\[\s*([^]]+?)\s*\]", line):
                current = header[1]
                if not section and current == key:
                    return Span(number, header.start(1) + 1, header.end(1) + 1)
            elif current == section and (match := re.match(rf"\s*({re.escape(key)})\s*=", line)):
                return Span(number, match.start(1) + 1, match.end(1) + 1)
        return Span(1, 1, 1)
