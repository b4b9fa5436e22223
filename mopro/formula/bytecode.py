"""Formulas as codes of a small stack machine, which compiled equations of motion evaluate.

The machine is compiled once and serves all formulas, so that a formula costs no compilation.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.formula.expressions import PI, ZERO_C_IN_K, Formula
from mopro.process.jit import njit

Floats = NDArray[np.float64]
Codes = NDArray[np.int64]
# Operands that a formula may stack: more than its levels can need.
MOST_STACKED = 200
_compiled: Callable[..., Any] = njit(cache=True, nogil=True, error_model="numpy")

(_VARIABLE, _ADD, _SUB, _MUL, _DIV, _POW, _NEG, _NOT, _AND, _OR, _LT, _LE, _GT, _GE, _EQ, _NE,
 _SELECT, _SIN, _COS, _TAN, _ASIN, _ACOS, _ATAN, _ATAN2, _SINH, _COSH, _TANH, _EXP, _LOG, _SQRT,
 _ABS, _SIGN, _MIN, _MAX, _KELVIN, _SQUARE, _CUBE) = range(37)  # fmt: skip
_OF_BINARY: dict[type[ast.operator], int] = {
    ast.Add: _ADD, ast.Sub: _SUB, ast.Mult: _MUL, ast.Div: _DIV, ast.Pow: _POW,
}  # fmt: skip
_OF_COMPARE: dict[type[ast.cmpop], int] = {
    ast.Lt: _LT, ast.LtE: _LE, ast.Gt: _GT, ast.GtE: _GE, ast.Eq: _EQ, ast.NotEq: _NE,
}  # fmt: skip
_OF_CALL = {
    "sin": _SIN, "cos": _COS, "tan": _TAN, "asin": _ASIN, "acos": _ACOS, "atan": _ATAN,
    "atan2": _ATAN2, "sinh": _SINH, "cosh": _COSH, "tanh": _TANH, "exp": _EXP, "log": _LOG,
    "sqrt": _SQRT, "abs": _ABS, "sign": _SIGN, "min": _MIN, "max": _MAX, "kelvin": _KELVIN,
}  # fmt: skip


def jumps(codes: Iterable[tuple[int, int]]) -> bool:
    """True if the codes have a sign or a comparison, whose value jumps."""
    return any(code == _SIGN or code in _OF_COMPARE.values() for code, _ in codes)


class Assembler:
    """Makes codes of formulas; their constants have the places from `first` on."""

    def __init__(self, first: int) -> None:
        self._first = first
        self.constants: list[float] = []

    def codes(self, formula: Formula, slots: Mapping[str, int]) -> list[tuple[int, int]]:
        """The codes that leave the value of `formula` on the stack; `slots` of its variables."""
        made: list[tuple[int, int]] = []
        self._add(formula.tree, slots, made)
        return made

    def sum(self, parts: Iterable[list[tuple[int, int]]]) -> list[tuple[int, int]]:
        """The codes of the sum of some formulas' codes; none for none."""
        made: list[tuple[int, int]] = []
        for nth, part in enumerate(parts):
            made += [*part, (_ADD, 0)] if nth else part
        return made

    def quotient(
        self, codes: list[tuple[int, int]], divisor: list[tuple[int, int]]
    ) -> list[tuple[int, int]]:
        """The codes of one value divided by another; none for none."""
        return [*codes, *divisor, (_DIV, 0)] if codes and divisor else codes

    def _constant(self, value: float) -> tuple[int, int]:
        self.constants.append(value)
        return _VARIABLE, self._first + len(self.constants) - 1

    def _add(self, node: ast.expr, slots: Mapping[str, int], made: list[tuple[int, int]]) -> None:
        """Append the codes of a node: those of its operands, and then its own."""
        for part in _operands(node):
            self._add(part, slots, made)
        match node:
            case ast.Constant(value=value):
                made.append(self._constant(float(value)))  # type: ignore[arg-type]
            case ast.Name(id=name):
                made.append((_VARIABLE, slots[name]) if name in slots else self._constant(math.pi))
            case ast.Call(func=ast.Name(id=called), args=args):
                made += [(_OF_CALL[called], 0)] * max(len(args) - 1, 1)
            case ast.BoolOp(op=op, values=values):
                code = _AND if isinstance(op, ast.And) else _OR
                made += [(code, 0)] * (len(values) - 1)
            case _:
                made += [(code, 0) for code in _codes_of(node)]


def _operands(node: ast.expr) -> list[ast.expr]:
    """The operands of a node, in the order in which they are stacked."""
    match node:
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=2 | 3)):
            return [left]
        case ast.BinOp(left=left, right=right):
            return [left, right]
        case ast.UnaryOp(operand=operand):
            return [operand]
        case ast.BoolOp(values=values):
            return values
        case ast.Compare(left=left, comparators=[right]):
            return [left, right]
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return [test, body, orelse]
        case ast.Call(args=args):
            return args
    return []


def _codes_of(node: ast.expr) -> list[int]:
    """The codes of an operator."""
    match node:
        case ast.BinOp(op=ast.Pow(), right=ast.Constant(value=2)):
            return [_SQUARE]
        case ast.BinOp(op=ast.Pow(), right=ast.Constant(value=3)):
            return [_CUBE]
        case ast.BinOp(op=op):
            return [_OF_BINARY[type(op)]]
        case ast.UnaryOp(op=op):
            return {ast.UAdd: [], ast.USub: [_NEG]}.get(type(op), [_NOT])
        case ast.Compare(ops=[compared]):
            return [_OF_COMPARE[type(compared)]]
        case ast.IfExp():
            return [_SELECT]
    raise TypeError(f"not of the language: {ast.dump(node)}")


assert PI == "pi", "the assembler takes a name without a slot for pi"


@_compiled
def value_of(codes: Codes, first: int, last: int, variables: Floats, stack: Floats) -> float:
    """The value of the codes `first` to `last` (exclusive); 0 for none."""
    top = -1
    for i in range(first, last):
        code = codes[i, 0]
        if code == _VARIABLE:
            top += 1
            stack[top] = variables[codes[i, 1]]
        elif code <= _POW:
            top -= 1
            stack[top] = _binary(code, stack[top], stack[top + 1])
        elif code == _NEG:
            stack[top] = -stack[top]
        elif code == _SQUARE:
            stack[top] = stack[top] * stack[top]
        elif code == _CUBE:
            stack[top] = stack[top] * stack[top] * stack[top]
        elif code == _SELECT:
            top -= 2
            stack[top] = stack[top + 1] if stack[top] != 0 else stack[top + 2]
        elif code in (_ATAN2, _MIN, _MAX) or _AND <= code <= _NE:
            top -= 1
            stack[top] = _logical(code, stack[top], stack[top + 1])
        else:
            stack[top] = _function(code, stack[top])
    result: float = stack[0] if top >= 0 else 0.0
    return result


@_compiled
def _binary(code: int, a: float, b: float) -> float:
    if code == _ADD:
        return a + b
    if code == _SUB:
        return a - b
    if code == _MUL:
        return a * b
    if code == _DIV:
        return a / b
    result: float = a**b
    return result


@_compiled
def _logical(code: int, a: float, b: float) -> float:
    if code == _MIN:
        return min(a, b)
    if code == _MAX:
        return max(a, b)
    if code == _ATAN2:
        return math.atan2(a, b)
    true = False
    if code == _AND:
        true = a != 0 and b != 0
    elif code == _OR:
        true = a != 0 or b != 0
    elif code == _LT:
        true = a < b
    elif code == _LE:
        true = a <= b
    elif code == _GT:
        true = a > b
    elif code == _GE:
        true = a >= b
    elif code == _EQ:
        true = a == b
    else:
        true = a != b
    return 1.0 if true else 0.0


@_compiled
def _function(code: int, a: float) -> float:
    result: float = math.nan
    if code == _NOT:
        result = 1.0 if a == 0 else 0.0
    elif code == _ABS:
        result = abs(a)
    elif code == _SIGN:
        result = np.sign(a)
    elif code == _KELVIN:
        result = a + ZERO_C_IN_K
    elif code == _EXP:
        result = np.exp(a)
    elif code == _SQRT:
        result = np.sqrt(a)
    elif code == _LOG:
        result = np.log(a)
    else:
        result = _of_an_angle(code, a)
    return result


@_compiled
def _of_an_angle(code: int, a: float) -> float:
    result: float = math.nan
    if code == _SIN:
        result = math.sin(a)
    elif code == _COS:
        result = math.cos(a)
    elif code == _TANH:
        result = math.tanh(a)
    elif code == _TAN:
        result = math.tan(a)
    elif code == _ASIN:
        result = np.arcsin(a)
    elif code == _ACOS:
        result = np.arccos(a)
    elif code == _ATAN:
        result = math.atan(a)
    elif code == _SINH:
        result = np.sinh(a)
    else:
        result = np.cosh(a)
    return result
