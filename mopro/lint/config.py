"""Settings from `mopro.toml`, or from `[tool.mopro]` of `pyproject.toml`."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import Field, replace
from functools import partial
from pathlib import Path
from typing import Any

from mopro.errors import Diagnostic, ModelError
from mopro.lint.rule import Settings
from mopro.source import Source, Span
from mopro.tomlfile import Document, Unreadable, Value, read_text, shown
from mopro.tomlfile.schema import Reader, one_of, quantity, record, signed_quantity, table_in, text

FILES = ("mopro.toml", "pyproject.toml")
_RULE = "bad-settings"
_NO_LENGTHS = 'expected a length for each axis, such as { 1 = "20 in" }'


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
    try:
        document = Document(Source(str(path), read_text(path)))
        return document.read(partial(_settings, path=path))
    except Unreadable as error:
        finding = Diagnostic(_RULE, f"cannot be read: {error}", Span(1, 1, 1))
        raise ModelError(Source(str(path), ""), [finding]) from error
    except ModelError as error:
        raise ModelError(error.source, map(_as_setting, error.diagnostics)) from error


def _as_setting(finding: Diagnostic) -> Diagnostic:
    """`finding` under the rule name of settings."""
    unread = finding.rule in ("bad-toml", "too-large")
    message = f"cannot be read: {finding.message}" if unread else finding.message
    return replace(finding, rule=_RULE, message=message)


def check_rule_names(names: Collection[str]) -> frozenset[str]:
    """`names`, all of them rules; ValueError names the first that is not."""
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
        raise ValueError(_NO_LENGTHS)
    return {int(axis): parse_quantity(str(text), "length", "m") for axis, text in value.items()}


def _settings(root: Value, path: Path) -> Settings | None:
    tool = root["tool"] if isinstance(root.data.get("tool"), dict) else root
    stated = tool is not root and "mopro" in tool
    if not stated and path.name == "pyproject.toml":
        return None
    table = table_in(tool["mopro"]) if stated else root
    settings = record(Settings, _reader_of)(table)
    if settings.machine.endswith(".toml"):
        return replace(settings, machine=str(path.parent / settings.machine))
    return settings


def _reader_of(part: Field[Any]) -> Reader[Any]:
    return _READERS[part.metadata.get("key", part.name)]


def _rules(value: Value) -> frozenset[str]:
    names = value.data
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise value.refused('expected a list of rules, such as ["stall", "low-margin"]')
    try:
        return check_rule_names(names)
    except ValueError as error:
        raise value.refused(f"{value.key}: {shown(error, 200)}") from error


def _lengths(value: Value) -> dict[int, float]:
    from mopro.program import AXES

    if not isinstance(value.data, dict) or not value.data.keys() <= set(map(str, AXES)):
        raise value.refused(f"{value.key}: {_NO_LENGTHS}")
    read = signed_quantity("length", "m")
    return {int(axis): read(value[axis]) for axis in value.data}


def _grammar(value: Value) -> str:
    from mopro.language.parse import GRAMMARS

    return one_of(*GRAMMARS)(value)


_READERS: dict[str, Reader[Any]] = {
    "machine": text(empty=True, message="machine: expected a string"),
    "payload": quantity("mass", "kg"),
    "grammar": _grammar,
    "select": _rules,
    "ignore": _rules,
    "low-margin": quantity("ratio", "1"),
    "start": _lengths,
    "travel": _lengths,
}
