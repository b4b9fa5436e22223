"""Formulas as codes of a small stack machine, which compiled equations of motion evaluate.

The machine is compiled once and serves all formulas, so that a formula costs no compilation.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from mopro.formula.language import PI, Formula

Floats = NDArray[np.float64]
Codes = NDArray[np.int64]
# Operands that a formula may stack: more than its levels can need.
MOST_STACKED = 200
_compiled: Callable[..., Any] = numba.njit(cache=True, nogil=True, error_model="numpy")

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
_POWERS = {2: _SQUARE, 3: _CUBE}


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

    def _add(
        self, node: ast.expr, slots: Mapping[str, int], made: list[tuple[int, int]]
    ) -> None:
        def operands(*parts: ast.expr) -> None:
            for part in parts:
                self._add(part, slots, made)

        match node:
            case ast.Constant(value=value):
                made.append(self._constant(float(value)))  # type: ignore[arg-type]
            case ast.Name(id=name):
                made.append((_VARIABLE, slots[name]) if name in slots else self._constant(math.pi))
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as power)) if (
                power in _POWERS
            ):
                operands(left)
                made.append((_POWERS[power], 0))
            case ast.BinOp(left=left, op=op, right=right):
                operands(left, right)
                made.append((_OF_BINARY[type(op)], 0))
            case ast.UnaryOp(op=op, operand=operand):
                operands(operand)
                if not isinstance(op, ast.UAdd):
                    made.append((_NEG if isinstance(op, ast.USub) else _NOT, 0))
            case ast.BoolOp(op=op, values=[first, *others]):
                operands(first)
                for other in others:
                    operands(other)
                    made.append((_AND if isinstance(op, ast.And) else _OR, 0))
            case ast.Compare(left=left, ops=[compared], comparators=[right]):
                operands(left, right)
                made.append((_OF_COMPARE[type(compared)], 0))
            case ast.IfExp(test=test, body=body, orelse=orelse):
                operands(test, body, orelse)
                made.append((_SELECT, 0))
            case ast.Call(func=ast.Name(id=called), args=[first, *others]):
                operands(first)
                for other in others:
                    operands(other)
                    made.append((_OF_CALL[called], 0))
                if not others:
                    made.append((_OF_CALL[called], 0))
            case _:
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
        elif code == _ATAN2 or code == _MIN or code == _MAX or _AND <= code <= _NE:
            top -= 1
            stack[top] = _logical(code, stack[top], stack[top + 1])
        else:
            stack[top] = _function(code, stack[top])
    return stack[0] if top >= 0 else 0.0


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
    return a**b


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
    if code == _NOT:
        return 1.0 if a == 0 else 0.0
    if code == _ABS:
        return abs(a)
    if code == _SIGN:
        return 1.0 if a > 0 else -1.0 if a < 0 else a * 0.0
    if code == _SIN:
        return math.sin(a)
    if code == _COS:
        return math.cos(a)
    if code == _EXP:
        return np.exp(a)
    if code == _TANH:
        return math.tanh(a)
    if code == _KELVIN:
        return a + 273.15
    if code == _SQRT:
        return np.sqrt(a)
    if code == _LOG:
        return np.log(a)
    if code == _TAN:
        return math.tan(a)
    if code == _ASIN:
        return np.arcsin(a)
    if code == _ACOS:
        return np.arccos(a)
    if code == _ATAN:
        return math.atan(a)
    if code == _SINH:
        return np.sinh(a)
    return np.cosh(a)
