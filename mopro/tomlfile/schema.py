"""Readers of TOML values: of single values, and of tables into dataclasses.

A reader converts a `Value`; a fault is reported at its place, and `Refused` is raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, Field, field, fields
from typing import Any, TypeVar

from mopro.tomlfile.document import Refused, Value
from mopro.tomlfile.shown import shown
from mopro.units import parse_quantity

T = TypeVar("T")
Reader = Callable[[Value], T]

_LONGEST_QUANTITY = 60


def number_in(data: Any) -> float | None:
    """`data` as a finite number; None if it is none."""
    if isinstance(data, bool) or not isinstance(data, int | float) or not math.isfinite(data):
        return None
    return float(data)


def number(low: float, high: float = math.inf, above: bool = False) -> Reader[float]:
    """A finite number from `low` to `high`; greater than `low` if `above`."""
    if high < math.inf:
        bounds = f"from {low:g} to {high:g}"
    else:
        bounds = f"above {low:g}" if above else f"of at least {low:g}"

    def read(value: Value) -> float:
        found = number_in(value.data)
        if found is None or not low <= found <= high or (above and found == low):
            raise value.refused(f"expected {value.key}: a number {bounds}")
        return found

    return read


def whole(low: int | None = None, high: int | None = None) -> Reader[int]:
    """An integer, from `low` to `high` if they are given."""
    bounds = "" if low is None or high is None else f" from {low} to {high}"

    def read(value: Value) -> int:
        found = value.data
        fits = isinstance(found, int) and not isinstance(found, bool)
        if not fits or (low is not None and found < low) or (high is not None and found > high):
            raise value.refused(f"expected {value.key}: a whole number{bounds}")
        return int(found)

    return read


def flag(value: Value) -> bool:
    """true or false."""
    if not isinstance(value.data, bool):
        raise value.refused(f"expected {value.key}: true or false")
    return value.data


def text(
    empty: bool = False,
    ascii_only: bool = False,
    message: str | None = None,
    rule: str = "bad-value",
) -> Reader[str]:
    """A string, not an empty one unless `empty`; `message` if it is none."""

    def read(value: Value) -> str:
        if not isinstance(value.data, str) or not (value.data or empty):
            raise value.refused(message or f'expected {value.key} = "text"', rule)
        if ascii_only and not value.data.isascii():
            raise value.refused(f"{value.key} must be plain ASCII")
        return value.data

    return read


def one_of(*choices: T, message: str | None = None, rule: str = "bad-value") -> Reader[T]:
    """One of some strings or numbers; `message` if it is none of them."""
    listed = ", ".join(map(str, choices))

    def read(value: Value) -> T:
        for choice in choices:
            if value.data == choice and not isinstance(value.data, bool):
                return choice
        raise value.refused(message or f"expected {value.key}: one of {listed}", rule)

    return read


def quantity(dimension: str, unit: str) -> Reader[float]:
    """A quantity of at least 0 as a person types it (`"5lb"`), in SI; a bare one has `unit`."""
    signed = signed_quantity(dimension, unit)

    def read(value: Value) -> float:
        found = signed(value)
        if found < 0:
            raise value.refused(f"{value.key}: '{shown(value.data)}' must be at least 0")
        return found

    return read


def signed_quantity(dimension: str, unit: str) -> Reader[float]:
    """As `quantity`, of either sign."""

    def read(value: Value) -> float:
        typed = str(value.data)
        if len(typed) > _LONGEST_QUANTITY:
            raise value.refused(f"expected {value.key}: a quantity, such as 1.5{unit}")
        try:
            return parse_quantity(typed, dimension, unit)
        except ValueError as error:
            raise value.refused(f"{value.key}: {shown(error, 200)}") from error

    return read


# -- tables ------------------------------------------------------------------------


def stated(read: Reader[Any], default: Any = MISSING, absent: str = "missing-key") -> Any:
    """A dataclass field that a file states under its name, as `read` reads it.

    `absent` is the rule that a file without it breaks, unless there is a default.
    """
    return field(default=default, metadata={"read": read, "absent": absent})


def section(read: Reader[Any], default: Any = MISSING) -> Any:
    """A dataclass field that is a section of the file."""
    return field(default=default, metadata={"read": read, "section": True})


def _reader_of(part: Field[Any]) -> Reader[Any]:
    read: Reader[Any] = part.metadata["read"]
    return read


def record(
    kind: Callable[..., T],
    reader_of: Callable[[Field[Any]], Reader[Any]] = _reader_of,
) -> Reader[T]:
    """A table as the dataclass `kind`: a key for each field, those without default needed.

    A field has the key `metadata["key"]`, or else its name, and the reader that
    `reader_of` gives. All findings of the table are noted before it is refused.
    """
    parts = {part.metadata.get("key", part.name): part for part in fields(kind)}  # type: ignore[arg-type]

    def read(value: Value) -> T:
        table = table_in(value)
        before = table.faults
        table.only(parts)
        values = {}
        for key, part in parts.items():
            if key in table or part.default is part.default_factory is MISSING:
                rule = part.metadata.get("absent", "missing-key")
                values[part.name] = table.need(key, reader_of(part), _absent(table, part), rule)
        if table.faults > before:
            raise Refused
        return kind(**values)

    return read


def table_in(value: Value) -> Value:
    """The value itself, if it is a table."""
    if not isinstance(value.data, dict):
        raise value.refused(f"expected a section [{value.name}]", "missing-key")
    return value


def _absent(table: Value, part: Field[Any]) -> str:
    key = part.metadata.get("key", part.name)
    if part.metadata.get("section"):
        return f"expected a section [{key}]"
    return f"[{table.name}] has no {key}" if table.name else f"the file has no {key}"
