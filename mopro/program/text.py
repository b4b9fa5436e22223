"""IR to text: the canonical statements for the wire, the listing and the JSON to read."""

from __future__ import annotations

import json
from dataclasses import fields
from fractions import Fraction
from functools import singledispatch
from typing import Any

from mopro.program import ir
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


def _axis(op: ir.AxisOp) -> str:
    return "0" if op.axes == ir.AXES else str(op.axes[0])


@singledispatch
def statement(op: ir.Op) -> str:
    """One operation as its canonical statement."""
    raise TypeError(f"no statement for {type(op).__name__}")


@statement.register
def _(op: ir.SetUnits) -> str:
    return f"UU{_axis(op)}{op.numerator}/{op.denominator}"


@statement.register
def _(op: ir.SetVelocity) -> str:
    return f"VEL{_axis(op)} {decimal(op.velocity_uu_s)}"


@statement.register
def _(op: ir.SetAcceleration) -> str:
    return f"ACC{_axis(op)} {decimal(op.acceleration_uu_s2 / MS_PER_S)}"


@statement.register
def _(op: ir.SetProfile) -> str:
    return f"PARA{_axis(op)}{'+' if op.parabolic else '-'}"


@statement.register
def _(op: ir.Move) -> str:
    return f"{'MAI' if op.absolute else 'MRI'}{_axis(op)} {decimal(op.distance_uu)}"


@statement.register
def _(op: ir.SetTarget) -> str:
    return f"{'MA' if op.absolute else 'MR'}{_axis(op)} {decimal(op.distance_uu)}"


@statement.register
def _(op: ir.Go) -> str:
    return "GO"


@statement.register
def _(op: ir.WaitAxis) -> str:
    return f"WX{_axis(op)}"


@statement.register
def _(op: ir.Dwell) -> str:
    return f"WT{op.milliseconds}"


@statement.register
def _(op: ir.Label) -> str:
    return f":{op.name}"


@statement.register
def _(op: ir.Jump) -> str:
    return f"JUMP {op.name}"


@statement.register
def _(op: ir.Continuous) -> str:
    return f"MC{_axis(op)} {decimal(op.velocity_uu_s)}"


@statement.register
def _(op: ir.Seek) -> str:
    return f"SK{_axis(op)} {decimal(op.velocity_uu_s)}"


@statement.register
def _(op: ir.Stop) -> str:
    return f"ST{_axis(op)}"


@statement.register
def _(op: ir.Home) -> str:
    return f"HM{_axis(op)}"


def _described(op: ir.Op) -> str:
    values = {name: value for name, value in _op_json(op).items() if name not in ("op", "at")}
    return " ".join([_op_name(op), *(f"{k}={_shown(v)}" for k, v in values.items())]).rstrip()


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))


def _op_json(op: ir.Op) -> dict[str, Any]:
    own = {f.name: _plain(getattr(op, f.name)) for f in fields(op) if f.name != "span"}
    return {"op": _op_name(op), "at": [op.span.line, op.span.column], **own}


def _op_name(op: ir.Op) -> str:
    """`SetVelocity` as `set_velocity`."""
    name = type(op).__name__
    return name[0].lower() + "".join(f"_{c.lower()}" if c.isupper() else c for c in name[1:])


def _plain(value: Any) -> Any:
    if isinstance(value, Fraction):
        return int(value) if value.denominator == 1 else decimal(value)
    return list(value) if isinstance(value, tuple) else value
