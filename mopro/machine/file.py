"""Machine files: TOML in which each value states its unit and where it comes from."""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, fields
from functools import cache
from pathlib import Path
from typing import Any

from mopro.machine.model import (
    Axis,
    Drive,
    Forcers,
    Heat,
    Limits,
    Machine,
    Platen,
    Provenance,
    StatedEffect,
    StatedValue,
)
from mopro.program import AXES
from mopro.source import Source
from mopro.tomlfile import TomlReader, parse_toml, read_named
from mopro.units import to_si

ORIGINS = ("thesis", "derived", "assumed", "measured")
_SECTIONS: dict[str, type[Any]] = {"axis": Axis, "drive": Drive, "platen": Platen, "heat": Heat}
_OPTIONAL: dict[str, type[Any]] = {"forcers": Forcers, "limits": Limits}
_EFFECTS = "effects"
# Beside this file in a checkout and when installed; importlib.resources takes longer to
# import than the machine takes to read.
_FOLDER = Path(__file__).with_name("machines")
_VALUE_KEYS = {"value", "unit", "origin", "place"}
_TOLERANCE = "tolerance"


def builtin_machines() -> list[str]:
    """The names that `load_machine` knows without a file."""
    folder = _FOLDER
    return sorted(
        p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml")
    )


@cache
def _builtin(name: str) -> Machine:
    file = _FOLDER / f"{name}.toml"
    return read_machine(Source(f"{name}.toml", file.read_text("utf-8")))


def load_machine(name_or_path: str) -> Machine:
    """The built-in machine of that name, or the one in that file; else ModelError."""
    if name_or_path in builtin_machines():
        return _builtin(name_or_path)
    return read_machine(read_named("machine", name_or_path, builtin_machines()))


def read_machine(source: Source) -> Machine:
    """The machine that `source` describes; ModelError with all findings, by line."""
    return _Reader(source, parse_toml(source)).machine()


class _Reader(TomlReader):
    """Takes a machine file's data apart."""

    def __init__(self, source: Source, data: dict[str, Any]) -> None:
        super().__init__(source, data)
        self._provenance: dict[str, Provenance] = {}

    def machine(self) -> Machine:
        self._known("", self._data, {"name", _EFFECTS, *_SECTIONS, *_OPTIONAL})
        name = self._data.get("name")
        if not isinstance(name, str) or not name:
            self._report("missing-key", 'expected a name, such as name = "mine"', "", "name")
        parts = {key: self._section(key, kind) for key, kind in _SECTIONS.items()}
        for key, kind in _OPTIONAL.items():
            if key in self._data:
                parts[key] = self._section(key, kind)
        effects = self._effects()
        self._check()
        return Machine(
            name=str(name),
            provenance=self._provenance,
            effects=effects,
            source=self._source,
            **parts,
        )

    def _effects(self) -> tuple[StatedEffect, ...]:
        tables = self._data.get(_EFFECTS, {})
        if not isinstance(tables, dict):
            self._report("bad-value", "expected sections such as [effects.NAME]", "", _EFFECTS)
            return ()
        return tuple(self._effect(name, table) for name, table in tables.items())

    def _effect(self, name: str, table: Any) -> StatedEffect:
        section = f"{_EFFECTS}.{name}"
        if not isinstance(table, dict):
            self._report("bad-value", f"expected a section [{section}]", _EFFECTS, name)
            table = {}
        values = {
            key: self._stated(section, key, entry) for key, entry in table.items() if key != "axes"
        }
        axes = table.get("axes", list(AXES))
        if not isinstance(axes, list) or not axes or any(axis not in AXES for axis in axes):
            self._report("bad-value", "expected axes such as [1] or [1, 2]", section, "axes")
            axes = []
        return StatedEffect(name, values, tuple(axes), self._place("", section))

    def _stated(self, section: str, key: str, entry: Any) -> StatedValue:
        """A bare number, or a table with value and unit."""
        number = entry.get("value") if isinstance(entry, dict) else entry
        unit = None
        if isinstance(entry, dict):
            self._known(section, entry, _VALUE_KEYS, at=key)
            self._origin(section, key, entry)
            unit = str(entry.get("unit"))
        if isinstance(number, bool) or not isinstance(number, int | float):
            message = f"expected {key} = number, or {key} = {{ value = number, unit = ... }}"
            self._report("bad-value", message, section, key)
            number = 0.0
        return StatedValue(float(number), unit, self._place(section, key))

    def _origin(self, section: str, key: str, entry: dict[str, Any]) -> None:
        if entry.get("origin") not in ORIGINS:
            message = f"expected an origin of {key}: one of {', '.join(ORIGINS)}"
            self._report("missing-origin", message, section, key)
        self._provenance[f"{section}.{key}"] = Provenance(
            str(entry.get("origin")),
            str(entry.get("place", "")),
            self._tolerance(section, key, entry.get(_TOLERANCE, 0.0)),
        )

    def _tolerance(self, section: str, key: str, share: Any) -> float:
        if isinstance(share, int | float) and not isinstance(share, bool) and 0 <= share < 1:
            return float(share)
        message = f"expected the tolerance of {key} as a share of it, such as 0.1"
        self._report("bad-value", message, section, key)
        return 0.0

    def _section(self, section: str, kind: type[Any]) -> Any:
        table = self._data.get(section)
        if not isinstance(table, dict):
            self._report("missing-key", f"expected a section [{section}]", "", section)
            return None
        quantities = fields(kind)
        self._known(section, table, {f.metadata["key"] for f in quantities})
        values = {f.name: self._value(section, table, f) for f in quantities}
        return None if None in values.values() else kind(**values)

    def _value(self, section: str, table: dict[str, Any], quantity: Field[Any]) -> Any:
        key = quantity.metadata["key"]
        if key not in table:
            if quantity.default is not MISSING:
                return quantity.default
            self._report("missing-key", f"[{section}] has no {key}", "", section)
            return None
        if choices := quantity.metadata.get("choices"):
            return self._word(section, key, table[key], choices)
        return self._quantity(section, table, quantity)

    def _word(self, section: str, key: str, word: Any, choices: tuple[str, ...]) -> str | None:
        if word in choices:
            return str(word)
        message = f"expected {key} to be one of {', '.join(choices)}"
        self._report("bad-value", message, section, key)
        return None

    def _quantity(self, section: str, table: dict[str, Any], quantity: Field[Any]) -> float | None:
        key, dimension = quantity.metadata["key"], quantity.metadata["dimension"]
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
        known = _VALUE_KEYS | ({_TOLERANCE} if quantity.metadata["tolerated"] else set())
        self._known(section, entry, known, at=key)
        self._origin(section, key, entry)
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
