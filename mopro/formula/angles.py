"""Sines and cosines of whole multiples of an angle, from those of the angle itself.

A wave with its harmonics needs one sine and one cosine instead of two for each order.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.formula.evaluate import Floats, Values, over_grid
from mopro.formula.expressions import Formula

_SHARED = ("sin", "cos")
# An order is worked out from the one before it, each with a rounding error more: 4e-16 for each,
# less than that of the angle itself after a few turns.
_MOST_ORDERS = 16


@dataclass(frozen=True)
class Angles:
    """The angles of some formulas: `formulas` are the same with names for their sines and cosines.

    `least`: the formula of each angle by its text, and `orders` the multiples of it in use.
    """

    formulas: tuple[Formula, ...]
    least: Mapping[str, Formula]
    orders: Mapping[str, int]

    @classmethod
    def of(cls, formulas: Sequence[Formula]) -> Angles:
        factors: dict[str, dict[float, ast.expr]] = {}
        for formula in formulas:
            # A function of a whole signal takes no points of a grid.
            for node in () if formula.of_signals else ast.walk(formula.tree):
                found = _split(node)
                if found is not None:
                    factors.setdefault(found[1], {})[found[0]] = found[2]
        least = {text: min(own) for text, own in factors.items()}
        renamed = _Renamed(least)
        made = tuple(f if f.of_signals else renamed.of(f) for f in formulas)
        angles = {
            text: Formula(ast.unparse(own), own, frozenset())
            for text, own in ((text, factors[text][factor]) for text, factor in least.items())
        }
        return cls(made, angles, renamed.orders)

    def values(self, names: Values) -> dict[str, Floats]:
        """The sines and cosines by the names that `formulas` have for them."""
        found: dict[str, Floats] = {}
        for text, formula in self.least.items():
            angle = over_grid(formula, names)
            sine, cosine = s, c = np.sin(angle), np.cos(angle)
            for order in range(1, self.orders[text] + 1):
                if order > 1:
                    s, c = s * cosine + c * sine, c * cosine - s * sine
                found[_name("sin", order, text)], found[_name("cos", order, text)] = s, c
        return found


class _Renamed(ast.NodeTransformer):
    """Puts names in the place of sines and cosines; `orders`: the highest of each angle."""

    def __init__(self, least: Mapping[str, float]) -> None:
        self._least = least
        self.orders = dict.fromkeys(least, 1)

    def of(self, formula: Formula) -> Formula:
        return replace(formula, tree=self.visit(copy.deepcopy(formula.tree)))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        found = _split(node)
        if found is not None and isinstance(node.func, ast.Name):
            factor, text, _ = found
            order = factor / self._least[text]
            if order <= _MOST_ORDERS and order.is_integer():
                self.orders[text] = max(self.orders[text], int(order))
                return ast.Name(_name(node.func.id, int(order), text))
        node.args = [self.visit(part) for part in node.args]
        return node


def _name(called: str, order: int, text: str) -> str:
    """A name that no formula can have."""
    return f"{called} {order} {text}"


def _split(node: ast.AST) -> tuple[float, str, ast.expr] | None:
    """The number that the angle of a sine or cosine begins with, the text of the rest, the angle.

    None for any other node, and for an angle that begins otherwise.
    """
    match node:
        case ast.Call(func=ast.Name(id=called), args=[angle]) if called in _SHARED:
            parts: list[tuple[ast.operator, ast.expr]] = []
            inner = angle
            while isinstance(inner, ast.BinOp) and isinstance(inner.op, ast.Mult | ast.Div):
                parts.append((inner.op, inner.right))
                inner = inner.left
            if parts and isinstance(inner, ast.Constant) and inner.value:
                rest: ast.expr = ast.Constant(1)
                for op, right in reversed(parts):
                    rest = ast.BinOp(rest, op, right)
                return float(inner.value), ast.unparse(rest), angle  # type: ignore[arg-type]
    return None
