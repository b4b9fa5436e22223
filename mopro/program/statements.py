"""Operations as statements: IR to text, and the settings that lead to a later line."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import singledispatch
from typing import Any

from mopro.errors import Diagnostic, SourceError
from mopro.language import ast
from mopro.program import Program, ir
from mopro.source import Span
from mopro.text import snake_case
from mopro.units import MS_PER_S

# -- IR to text -------------------------------------------------------------------------------
# IR to text: the canonical statements for the wire, the listing and the JSON to read.


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


# -- a later beginning ------------------------------------------------------------------------
# Beginning a program at a later line, with the settings that lead to it.

_ORDER = {kind: n for n, kind in enumerate(ast.STATEMENTS.values())}


@dataclass(frozen=True)
class Resumed:
    """The program from `line` on; `settings` are the statements in force there."""

    program: Program
    line: int
    settings: tuple[str, ...]


def resume(program: Program, line: int) -> Resumed:
    """Begin `program` at source line `line`; SourceError if a run never gets there.

    The whole program stays, behind a jump, so that a loop can go back before the line.
    """
    path = list(program.reachable())
    at = next((i for i, op in enumerate(path) if op.span.line >= line), None)
    if at is None:
        message = f"no statement at or after line {line} is ever run"
        finding = Diagnostic("no-such-line", message, Span(max(line, 1), 1, 1))
        raise SourceError(program.source, [finding])
    first = path[at]
    settings = _in_force(path[:at])
    label = _free_label(program)
    index = next(i for i, op in enumerate(program.ops) if op is first)
    ops = (
        *settings,
        ir.Jump(first.span, label),
        *program.ops[:index],
        ir.Label(first.span, label),
        *program.ops[index:],
    )
    return Resumed(
        Program(ops, program.source, program.warnings),
        first.span.line,
        tuple(statement(op) for op in settings),
    )


def _in_force(path: list[ir.Op]) -> list[ir.Op]:
    """The last setting of each kind for each axis, in the order of the language."""
    held: dict[tuple[type[ast.Statement], int], ir.Op] = {}
    for op in path:
        if isinstance(op, ir.Go):
            held = {key: value for key, value in held.items() if key[0] is not ast.Target}
        if isinstance(op, ir.AxisOp) and op.is_setting:
            for axis in op.axes:
                held[op.statement, axis] = replace(op, axes=(axis,))
    return [held[key] for key in sorted(held, key=lambda key: (_ORDER[key[0]], key[1]))]


def _free_label(program: Program) -> str:
    number = 1
    while f"FROM{number}" in program.labels:
        number += 1
    return f"FROM{number}"
