"""Settings from `mopro.toml`, or from `[tool.mopro]` of `pyproject.toml`."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from mopro.errors import Diagnostic, ModelError
from mopro.lint.settings import Settings
from mopro.source import Source, Span

FILES = ("mopro.toml", "pyproject.toml")


def find_settings(folder: Path) -> Settings:
    """The settings of the nearest configuration from `folder` upwards, or the defaults."""
    for place in (folder, *folder.parents):
        for name in FILES:
            path = place / name
            if path.is_file() and (settings := read_settings(path)) is not None:
                return settings
    return Settings()


def read_settings(path: Path) -> Settings | None:
    """The settings in `path`; None for a `pyproject.toml` that has none.

    A `mopro.toml` may leave the header `[tool.mopro]` out. Raises ModelError.
    """
    import tomllib

    try:
        text = path.read_text("utf-8")
        data = tomllib.loads(text)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise _unusable(path, "", "", f"cannot be read: {error}") from error
    tools = data.get("tool")
    table = tools.get("mopro") if isinstance(tools, dict) else None
    if table is None and path.name == "pyproject.toml":
        return None
    table = data if table is None else table
    if not isinstance(table, dict):
        raise _unusable(path, text, "mopro", "expected a table [tool.mopro]")
    return _settings(path, text, table)


def check_rule_names(names: Collection[str]) -> frozenset[str]:
    """`names`, all of them rules; ValueError tells the first that is none."""
    from mopro.lint.rules import RULES

    for name in names:
        if name not in RULES:
            from difflib import get_close_matches

            near = get_close_matches(name, RULES, n=1)
            hint = f": did you mean {near[0]}?" if near else ""
            raise ValueError(f"no rule is called {name}{hint}")
    return frozenset(names)


def lengths(value: Any) -> dict[int, float]:
    """`{1 = "20 in"}` as metres by axis; ValueError if it is not that."""
    from mopro.program import AXES
    from mopro.units import parse_quantity

    if not isinstance(value, dict) or not set(value) <= set(map(str, AXES)):
        raise ValueError('expected a length for each axis, such as { 1 = "20 in" }')
    return {int(axis): parse_quantity(str(text), "length", "m") for axis, text in value.items()}


def _settings(path: Path, text: str, table: dict[str, Any]) -> Settings:
    chosen: dict[str, Any] = {}
    for key, value in table.items():
        if key not in _READERS:
            known = ", ".join(_READERS)
            raise _unusable(path, text, key, f"unknown key {key}: known are {known}")
        field, read = _READERS[key]
        try:
            chosen[field] = read(value)
        except ValueError as error:
            raise _unusable(path, text, key, f"{key}: {error}") from error
    machine = chosen.get("machine", "")
    if machine.endswith(".toml"):
        chosen["machine"] = str(path.parent / machine)
    return replace(Settings(), **chosen)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("expected a string")
    return value


def _quantity(dimension: str, unit: str) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        from mopro.units import parse_quantity

        quantity = parse_quantity(str(value), dimension, unit)
        if quantity < 0:
            raise ValueError(f"'{value}' must be at least 0")
        return quantity

    return read


def _rules(value: Any) -> frozenset[str]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ValueError('expected a list of rules, such as ["stall", "low-margin"]')
    return check_rule_names(value)


def _grammar(value: Any) -> str:
    from mopro.language.parse import GRAMMARS

    if value not in GRAMMARS:
        raise ValueError(f"expected one of {', '.join(GRAMMARS)}")
    return str(value)


# key -> the field of the settings, and what makes the value of the key its value
_READERS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "machine": ("machine", _text),
    "payload": ("payload_kg", _quantity("mass", "kg")),
    "grammar": ("grammar", _grammar),
    "select": ("select", _rules),
    "ignore": ("ignore", _rules),
    "low-margin": ("low_margin", _quantity("ratio", "1")),
    "start": ("start_m", lengths),
    "travel": ("travel_m", lengths),
}


def _unusable(path: Path, text: str, key: str, message: str) -> ModelError:
    source = Source(str(path), text)
    for number, line in enumerate(source.lines, start=1):
        column = line.find(key) + 1
        if key and column and line.lstrip("[ ").startswith((key, f"tool.{key}")):
            span = Span(number, column, column + len(key))
            return ModelError(source, [Diagnostic("bad-settings", message, span)])
    return ModelError(source, [Diagnostic("bad-settings", message, Span(1, 1, 1))])
