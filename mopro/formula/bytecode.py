"""Formulas as operations of a small register machine, which compiled equations of motion carry out.

The machine is compiled once and serves all formulas, so that a formula costs no compilation. Each
operation has its result at a place of its own; what two formulas have in common is one operation.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.formula.expressions import PI, ZERO_C_IN_K, Formula
from mopro.process.jit import njit

Floats = NDArray[np.float64]
# How often a value changes: never in a run, with the time, with the state.
FIXED, TIMED, MOVING = range(3)
# No value, in place of one.
NONE = -1
_compiled: Callable[..., Any] = njit(cache=True, nogil=True, error_model="numpy")
# Part of the code that calls it, and without numba's runtime, which would count each use of an
# array: an integration by calls takes three times as long.
inlined: Callable[..., Any] = njit(nogil=True, error_model="numpy", forceinline=True, _nrt=False)

(_ADD, _SUB, _MUL, _DIV, _POW, _NEG, _NOT, _AND, _OR, _LT, _LE, _GT, _GE, _EQ, _NE,
 _SELECT, _SIN, _COS, _TAN, _ASIN, _ACOS, _ATAN, _ATAN2, _SINH, _COSH, _TANH, _EXP, _LOG, _SQRT,
 _ABS, _SIGN, _MIN, _MAX, _KELVIN, _SQUARE, _CUBE) = range(36)  # fmt: skip
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


@dataclass(frozen=True)
class Program:
    """Operations that lead from numbers to the values of formulas, in their order.

    Numbers are those with slots, then `constants`, then the result of each operation in turn.
    `operations` (m, 4): a code and the places of three operands, of which it takes what it needs.
    `segments` (2 + k, 2): the first operation and the one after the last of those whose results are
    fixed, of those that change with the time, and of what is left for each of k values; a later
    one takes what an earlier one has found. `results` (k,): the place of each value, or `NONE`.
    `slots`: the number of those.
    """

    operations: NDArray[np.int64]
    segments: NDArray[np.int64]
    results: NDArray[np.int64]
    constants: Floats
    slots: int

    def numbers(self) -> Floats:
        """All numbers, of which the constants are set."""
        found = np.zeros(self.slots + len(self.constants) + len(self.operations))
        found[self.slots : self.slots + len(self.constants)] = self.constants
        return found


class Assembler:
    """Makes the operations of a program, those that are alike once.

    A value is an index: the place of a slot, or what `value`, `sum` or `quotient` returns.
    `changes`: how often the number of each slot changes (`FIXED`, `TIMED`, `MOVING`).
    """

    def __init__(self, changes: Sequence[int]) -> None:
        self._slots = len(changes)
        # Of each value: what it is made of, and how often it changes.
        self._made: list[tuple[int, ...] | float] = [()] * self._slots
        self._changes = list(changes)
        self._known: dict[tuple[int, ...] | float, int] = {}

    def value(self, formula: Formula, names: Mapping[str, int]) -> int:
        """The value of a formula of values of these names."""
        return self._of(formula.tree, names)

    def sum(self, values: Iterable[int]) -> int:
        """The sum of some values; `NONE` of none."""
        total = NONE
        for value in values:
            total = value if total == NONE else self._operation(_ADD, total, value)
        return total

    def quotient(self, value: int, divisor: int) -> int:
        """One value divided by another, if there are both."""
        return value if NONE in (value, divisor) else self._operation(_DIV, value, divisor)

    def jumps(self, value: int) -> bool:
        """True if a sign or a comparison is part of a value, which then jumps."""
        codes = [self._operands(i)[0] for i in self._parts(value)]
        return any(code == _SIGN or code in _OF_COMPARE.values() for code in codes)

    def program(self, values: Sequence[int]) -> Program:
        """The operations that lead to these values."""
        left = dict.fromkeys(part for value in values for part in self._parts(value))
        groups = [
            sorted(part for part in left if self._changes[part] == often)
            for often in (FIXED, TIMED)
        ]
        for value in values:
            taken = {part for group in groups for part in group}
            groups.append(sorted(part for part in self._parts(value) if part not in taken))
        order = [part for group in groups for part in group]
        constants = [i for i, own in enumerate(self._made) if isinstance(own, float)]
        placed = [*range(self._slots), *constants, *order]
        places = {NONE: NONE, **{value: place for place, value in enumerate(placed)}}
        operations = [
            (code, *(places[own] for own in operands))
            for code, *operands in map(self._operands, order)
        ]
        ends = np.cumsum([0, *map(len, groups)])
        return Program(
            np.array(operations, dtype=np.int64).reshape(-1, 4),
            np.column_stack([ends[:-1], ends[1:]]).astype(np.int64),
            np.array([places[value] for value in values], dtype=np.int64),
            np.array([self._made[i] for i in constants], dtype=float),
            self._slots,
        )

    def _operands(self, value: int) -> tuple[int, ...]:
        """The code of an operation, and the values that it takes."""
        made = self._made[value]
        assert isinstance(made, tuple), "the value of an operation"
        return made

    def _parts(self, value: int) -> set[int]:
        """The operations that lead to a value."""
        found: set[int] = set()
        waiting = [value]
        while waiting:
            own = waiting.pop()
            if own >= self._slots and own not in found and isinstance(self._made[own], tuple):
                found.add(own)
                waiting += self._operands(own)[1:]
        return found

    def _new(self, made: tuple[int, ...] | float, change: int) -> int:
        if made not in self._known:
            self._known[made] = len(self._made)
            self._made.append(made)
            self._changes.append(change)
        return self._known[made]

    def _constant(self, value: float) -> int:
        return self._new(value, FIXED)

    def _operation(self, code: int, *operands: int) -> int:
        """The value of an operation; an operand that it does not take stands for one."""
        change = max(self._changes[own] for own in operands)
        return self._new((code, *operands, *operands[:1] * (3 - len(operands))), change)

    def _of(self, node: ast.expr, names: Mapping[str, int]) -> int:
        match node:
            case ast.Constant(value=value):
                return self._constant(float(value))  # type: ignore[arg-type]
            case ast.Name(id=name):
                return names[name] if name in names else self._constant(math.pi)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._of(operand, names)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self._operation(_SELECT, *(self._of(n, names) for n in (test, body, orelse)))
        code, parts = _operation_of(node)
        *before, value = [self._of(part, names) for part in parts]
        if not before:
            return self._operation(code, value)
        for other in reversed(before):
            value = self._operation(code, other, value)
        return value


def _operation_of(node: ast.expr) -> tuple[int, list[ast.expr]]:
    """The code of an operator or a function, and its operands."""
    match node:
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=2 | 3 as power)):
            return _SQUARE if power == 2 else _CUBE, [left]
        case ast.BinOp(left=left, op=op, right=right):
            return _OF_BINARY[type(op)], [left, right]
        case ast.UnaryOp(op=op, operand=operand):
            return _NEG if isinstance(op, ast.USub) else _NOT, [operand]
        case ast.BoolOp(op=op, values=values):
            return _AND if isinstance(op, ast.And) else _OR, values
        case ast.Compare(left=left, ops=[compared], comparators=[right]):
            return _OF_COMPARE[type(compared)], [left, right]
        case ast.Call(func=ast.Name(id=called), args=args):
            return _OF_CALL[called], args
    raise TypeError(f"not of the language: {ast.dump(node)}")


assert PI == "pi", "the assembler takes a name without a slot for pi"


@inlined
def carry_out(operations: Any, first: int, last: int, numbers: Floats) -> None:
    """Carry out the operations `first` to `last` (exclusive), each with its result in `numbers`."""
    at = len(numbers) - len(operations)
    for i in range(first, last):
        code = operations[i, 0]
        a, b = numbers[operations[i, 1]], numbers[operations[i, 2]]
        if code <= _POW:
            value = _binary(code, a, b)
        elif code == _NEG:
            value = -a
        elif code == _SQUARE:
            value = a * a
        elif code == _CUBE:
            value = a * a * a
        elif code == _SELECT:
            value = b if a != 0 else numbers[operations[i, 3]]
        elif code in (_ATAN2, _MIN, _MAX) or _AND <= code <= _NE:
            value = _logical(code, a, b)
        else:
            value = _function(code, a)
        numbers[at + i] = value


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
