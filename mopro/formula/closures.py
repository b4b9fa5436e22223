"""Formulas as Python functions that call each other, which a compiler can take as they are.

No code is made: each node of a formula becomes a closure over those of its operands.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence

from mopro.formula.expressions import ZERO_C_IN_K, Formula

# The values of the names in their order -> the value of the formula.
Closure = Callable[[tuple[float, ...]], float]


def closure_of(formula: Formula, names: Sequence[str], factors: Sequence[float]) -> Closure:
    """`formula` of the values of `names`, each multiplied by its factor.

    As with Python's own functions, a division by zero raises, unless it is compiled. Not for
    formulas of whole signals.
    """
    return _made(formula.tree, dict(zip(names, enumerate(factors), strict=True)))


def _made(node: ast.expr, names: dict[str, tuple[int, float]]) -> Closure:
    match node:
        case ast.Constant(value=value):
            return _constant(float(value))  # type: ignore[arg-type]
        case ast.Name(id=name):
            return _named(*names[name]) if name in names else _constant(math.pi)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=2 | 3 as power)):
            return _of_one(_square if power == 2 else _cube, _made(left, names))
        case ast.BinOp(left=left, op=op, right=right):
            return _of_two(_BINARY[type(op)], _made(left, names), _made(right, names))
        case ast.UnaryOp(op=op, operand=operand):
            inner = _made(operand, names)
            return inner if isinstance(op, ast.UAdd) else _of_one(_UNARY[type(op)], inner)
        case ast.Compare(left=left, ops=[compared], comparators=[right]):
            return _of_two(_COMPARE[type(compared)], _made(left, names), _made(right, names))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _choice(*(_made(part, names) for part in (test, body, orelse)))
        case ast.BoolOp(op=op, values=parts):
            joined = _and if isinstance(op, ast.And) else _or
            return _joined(joined, [_made(part, names) for part in parts])
        case ast.Call(func=ast.Name(id=called), args=args):
            inner_parts = [_made(part, names) for part in args]
            if called in _OF_TWO:
                return _joined(_OF_TWO[called], inner_parts)
            return _of_one(_OF_ONE[called], inner_parts[0])
    raise TypeError(f"not of the language: {ast.dump(node)}")


# -- nodes -------------------------------------------------------------------------------


def _constant(value: float) -> Closure:
    def constant(values: tuple[float, ...]) -> float:
        return value

    return constant


def _named(place: int, factor: float) -> Closure:
    def named(values: tuple[float, ...]) -> float:
        return values[place]

    def scaled(values: tuple[float, ...]) -> float:
        return values[place] * factor

    return named if factor == 1.0 else scaled


def _of_one(function: Callable[[float], float], inner: Closure) -> Closure:
    def of_one(values: tuple[float, ...]) -> float:
        return function(inner(values))

    return of_one


def _of_two(function: Callable[[float, float], float], left: Closure, right: Closure) -> Closure:
    def of_two(values: tuple[float, ...]) -> float:
        return function(left(values), right(values))

    return of_two


def _joined(function: Callable[[float, float], float], parts: Sequence[Closure]) -> Closure:
    total = parts[0]
    for part in parts[1:]:
        total = _of_two(function, total, part)
    return total


def _choice(test: Closure, body: Closure, orelse: Closure) -> Closure:
    def choice(values: tuple[float, ...]) -> float:
        return body(values) if test(values) != 0.0 else orelse(values)

    return choice


# -- operators and functions; a truth is 1, and what is not true 0 -------------------------


def _add(a: float, b: float) -> float:
    return a + b


def _subtract(a: float, b: float) -> float:
    return a - b


def _multiply(a: float, b: float) -> float:
    return a * b


def _divide(a: float, b: float) -> float:
    return a / b


def _power(a: float, b: float) -> float:
    return math.pow(a, b)


def _square(a: float) -> float:
    return a * a


def _cube(a: float) -> float:
    return a * a * a


def _negative(a: float) -> float:
    return -a


def _not(a: float) -> float:
    return 1.0 if a == 0.0 else 0.0


def _and(a: float, b: float) -> float:
    return 1.0 if a != 0.0 and b != 0.0 else 0.0


def _or(a: float, b: float) -> float:
    return 1.0 if a != 0.0 or b != 0.0 else 0.0


def _less(a: float, b: float) -> float:
    return 1.0 if a < b else 0.0


def _at_most(a: float, b: float) -> float:
    return 1.0 if a <= b else 0.0


def _greater(a: float, b: float) -> float:
    return 1.0 if a > b else 0.0


def _at_least(a: float, b: float) -> float:
    return 1.0 if a >= b else 0.0


def _equal(a: float, b: float) -> float:
    return 1.0 if a == b else 0.0


def _unequal(a: float, b: float) -> float:
    return 1.0 if a != b else 0.0


def _sign(a: float) -> float:
    return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else 0.0)


def _absolute(a: float) -> float:
    return abs(a)


def _least(a: float, b: float) -> float:
    return min(a, b)


def _most(a: float, b: float) -> float:
    return max(a, b)


def _kelvin(a: float) -> float:
    return a + ZERO_C_IN_K


def _sin(a: float) -> float:
    return math.sin(a)


def _cos(a: float) -> float:
    return math.cos(a)


def _tan(a: float) -> float:
    return math.tan(a)


def _asin(a: float) -> float:
    return math.asin(a)


def _acos(a: float) -> float:
    return math.acos(a)


def _atan(a: float) -> float:
    return math.atan(a)


def _atan2(a: float, b: float) -> float:
    return math.atan2(a, b)


def _sinh(a: float) -> float:
    return math.sinh(a)


def _cosh(a: float) -> float:
    return math.cosh(a)


def _tanh(a: float) -> float:
    return math.tanh(a)


def _exp(a: float) -> float:
    return math.exp(a)


def _log(a: float) -> float:
    return math.log(a)


def _sqrt(a: float) -> float:
    return math.sqrt(a)


_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: _add, ast.Sub: _subtract, ast.Mult: _multiply, ast.Div: _divide, ast.Pow: _power,
}  # fmt: skip
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {
    ast.USub: _negative, ast.Not: _not,
}  # fmt: skip
_COMPARE: dict[type[ast.cmpop], Callable[[float, float], float]] = {
    ast.Lt: _less, ast.LtE: _at_most, ast.Gt: _greater, ast.GtE: _at_least, ast.Eq: _equal,
    ast.NotEq: _unequal,
}  # fmt: skip
_OF_ONE: dict[str, Callable[[float], float]] = {
    "sin": _sin, "cos": _cos, "tan": _tan, "asin": _asin, "acos": _acos, "atan": _atan,
    "sinh": _sinh, "cosh": _cosh, "tanh": _tanh, "exp": _exp, "log": _log, "sqrt": _sqrt,
    "abs": _absolute, "sign": _sign, "kelvin": _kelvin,
}  # fmt: skip
_OF_TWO: dict[str, Callable[[float, float], float]] = {
    "atan2": _atan2, "min": _least, "max": _most,
}  # fmt: skip
