"""IR to text: the canonical statements for the wire, the listing and the JSON to read."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import fields
from fractions import Fraction
from functools import singledispatch
from typing import Any

from mopro.program import ir
from mopro.text import snake_case
from mopro.units import MS_PER_S

# A number of the language has at most 30 characters, and milliseconds take three more.
_MOST_DECIMALS = 40


def canonical(program: ir.Program) -> str:
    """The program as `.CMD` text in the one canonical form; it compiles to an equal program."""
    return "".join(f"{statement(op)}\n" for op in program.ops)


def listing(program: ir.Program) -> str:
    """A line for each operation: its index, source line, name and fields."""
    rows = [f"{i:>4}  line {op.span.line:<5} {_described(op)}" for i, op in enumerate(program.ops)]
    return "\n".join(rows) + "\n"


def as_json(program: ir.Program) -> dict[str, Any]:
    """The program as JSON-ready data; numbers that are not whole are exact decimal strings."""
    return {
        "program": program.name,
        "sha256": program.source.sha256,
        "ops": [_op_json(op) for op in program.ops],
    }


def decimal(value: Fraction) -> str:
    """`value` as an exact plain decimal, with at least one digit after the point."""
    digits = 1
    while (value * 10**digits).denominator != 1:
        digits += 1
        if digits > _MOST_DECIMALS:
            raise ValueError(f"{value} is not a plain decimal")
    scaled = abs(int(value * 10**digits))
    whole, part = divmod(scaled, 10**digits)
    return f"{'-' if value < 0 else ''}{whole}.{part:0{digits}d}"


def statement(op: ir.Op) -> str:
    """One operation as its canonical statement."""
    return op.written_as().layout.format(*map(_written, _operands(op)))


@singledispatch
def _operands(op: ir.Op) -> Iterable[Any]:
    """The values that the statement of `op` has as operands: those of its fields."""
    return (getattr(op, field.name) for field in fields(op) if field.name != "span")


@_operands.register
def _(op: ir.SetAcceleration) -> Iterable[Any]:
    return op.axes, op.acceleration_uu_s2 / MS_PER_S


@_operands.register
def _(op: ir.AxisDistance) -> Iterable[Any]:
    return op.axes, op.distance_uu


@_operands.register
def _(op: ir.Dwell) -> Iterable[Any]:
    return (str(op.milliseconds),)


def _written(value: Any) -> str:
    """A field's value as an operand."""
    match value:
        case bool():
            return "+" if value else "-"
        case Fraction():
            return decimal(value)
        case tuple():
            return "0" if value == ir.AXES else str(value[0])
        case _:
            return str(value)


def _described(op: ir.Op) -> str:
    values = {name: value for name, value in _op_json(op).items() if name not in ("op", "at")}
    return " ".join(
        [snake_case(type(op).__name__), *(f"{k}={_shown(v)}" for k, v in values.items())]
    ).rstrip()


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))


def _op_json(op: ir.Op) -> dict[str, Any]:
    own = {f.name: _plain(getattr(op, f.name)) for f in fields(op) if f.name != "span"}
    return {"op": snake_case(type(op).__name__), "at": [op.span.line, op.span.column], **own}


def _plain(value: Any) -> Any:
    if isinstance(value, Fraction):
        return int(value) if value.denominator == 1 else decimal(value)
    return list(value) if isinstance(value, tuple) else value
