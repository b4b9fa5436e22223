"""Values of formulas over whole signals, by numpy."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.engine.series import unless_run_away
from mopro.formula import signals
from mopro.formula.expressions import PI, ZERO_C_IN_K, Formula

Floats = NDArray[np.float64]
Values = Mapping[str, Floats | float]
Functions = Mapping[str, Callable[..., Floats]]

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos,
    "atan": np.arctan, "atan2": np.arctan2, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh,
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs, "sign": np.sign,
    "kelvin": lambda celsius: celsius + ZERO_C_IN_K,
}  # fmt: skip


def evaluate(
    formula: Formula, names: Values, time_s: Floats, functions: Functions = signals.SIGNALS
) -> Floats:
    """The formula at each of `time_s` (n,), for names that are numbers or arrays of that length.

    `functions`: those of whole signals. NaN where there is no value, or it has run away.
    """
    with np.errstate(all="ignore"):
        found = _value(formula.tree, names, time_s, functions)
    values = unless_run_away(np.asarray(found, dtype=float))
    return values if values.shape == time_s.shape else np.broadcast_to(values, time_s.shape)


def over_grid(formula: Formula, names: Values) -> Floats | float:
    """The formula for names that are numbers or arrays that broadcast to each other.

    Not for a formula of whole signals. Values that are infinite or have run away stay as they are;
    of those numpy would warn, unless the caller says that they are no fault.
    """
    found: Floats | float = _value(formula.tree, names, np.zeros(0), signals.SIGNALS)
    return found


def _value(node: ast.expr, names: Values, time_s: Floats, functions: Functions) -> Any:
    def of(part: ast.expr) -> Any:
        return _value(part, names, time_s, functions)

    match node:
        case ast.Constant(value=value):
            return np.float64(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            own = np.pi if name == PI and name not in names else names[name]
            # A number of Python would raise an error where numpy gives an infinity.
            return np.asarray(own, dtype=float) if np.ndim(own) else np.float64(own)
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](of(left), of(right))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return np.equal(of(operand), 0).astype(float)
        case ast.UnaryOp(op=op, operand=operand):
            return -of(operand) if isinstance(op, ast.USub) else of(operand)
        case ast.BoolOp(op=op, values=parts):
            tested = [np.not_equal(of(part), 0) for part in parts]
            joined = np.logical_and if isinstance(op, ast.And) else np.logical_or
            result = tested[0]
            for other in tested[1:]:
                result = joined(result, other)
            return np.asarray(result, dtype=float)
        case ast.Compare(left=left, ops=[compared], comparators=[right]):
            return np.asarray(_COMPARE[type(compared)](of(left), of(right)), dtype=float)
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return np.where(np.not_equal(of(test), 0), of(body), of(orelse))
        case ast.Call(func=ast.Name(id=called), args=args):
            return _called(called, [of(part) for part in args], time_s, functions)
    raise TypeError(f"not of the language: {ast.dump(node)}")


def _called(called: str, args: list[Any], time_s: Floats, functions: Functions) -> Any:
    if called in ("min", "max"):
        joined = np.minimum if called == "min" else np.maximum
        result = args[0]
        for other in args[1:]:
            result = joined(result, other)
        return result
    if called in _FUNCTIONS:
        return _FUNCTIONS[called](*args)
    signal = np.array(np.broadcast_to(args[0], time_s.shape), dtype=float)
    return functions[called](time_s, signal, *map(_number, args[1:]))


def _number(value: Any) -> float:
    """A parameter of a signal function: the mean where it varies."""
    return float(np.mean(value))
