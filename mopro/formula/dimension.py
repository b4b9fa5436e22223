"""Units as people write them (`N s2/m2`), their dimensions, and the dimension of a formula."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from fractions import Fraction

from mopro.formula.expressions import Formula, FormulaError, place
from mopro.units import UNITS, spelled

# Exponents of length, mass, time, current, temperature, count. An angle is a plain number.
Dimension = tuple[Fraction, ...]
_SIZE = 6
NUMBER: Dimension = (Fraction(0),) * _SIZE
_DIMENSIONS = {
    "ratio": (), "angle": (), "length": (1,), "mass": (0, 1), "time": (0, 0, 1),
    "current": (0, 0, 0, 1), "temperature": (0, 0, 0, 0, 1), "temperature difference":
    (0, 0, 0, 0, 1), "count": (0, 0, 0, 0, 0, 1), "frequency": (0, 0, -1), "force": (1, 1, -2),
    "energy": (2, 1, -2), "power": (2, 1, -3), "voltage": (2, 1, -3, -1),
    "resistance": (2, 1, -3, -2), "inductance": (2, 1, -2, -2), "angular velocity": (0, 0, -1),
}  # fmt: skip
_SYMBOL = re.compile(r"([A-Za-z%]+|1)(?:\^?(-?\d+(?:\.\d+)?))?", re.ASCII)
_EXPONENT = re.compile(r"\^?(-?\d+(?:\.\d+)?)", re.ASCII)
_TOKEN = re.compile(r"[()/]|[^\s()/]+")
_LONGEST = 60
MOST_FACTORS = 24
# Of a unit that a formula makes: powers of powers leave what a float holds.
LARGEST_EXPONENT = 1000


class UnitError(ValueError):
    """A text that is no unit."""


def _parsed(unit: str) -> list[tuple[str, Fraction]]:
    """Symbols of `unit` with their exponents: `N s2/(m K)` is N, s 2, m -1, K -1."""
    if len(unit) > _LONGEST:
        raise UnitError(f"a unit of more than {_LONGEST} characters")
    tokens = _TOKEN.findall(spelled(unit))[::-1]
    found = _product(tokens, unit)
    if tokens:
        raise UnitError(f"'{unit}' has more brackets closed than opened")
    if sum(abs(exponent) for _, exponent in found) > MOST_FACTORS:
        raise UnitError(f"'{unit}' has exponents of more than {MOST_FACTORS} in all")
    return found


def _product(tokens: list[str], unit: str, inner: bool = False) -> list[tuple[str, Fraction]]:
    """The symbols up to the end, or up to a bracket that ends a product within another.

    `tokens`, the next one last, are used up. What follows a `/` is below the line.
    """
    found: list[tuple[str, Fraction]] = []
    way, expected = 1, True
    while tokens and tokens[-1] != ")":
        token = tokens.pop()
        if token == "/":
            if expected:
                break
            way, expected = -1, True
            continue
        own = _product(tokens, unit, inner=True) if token == "(" else [_symbol(token, unit)]
        power = way * (_power_behind(tokens) if token == "(" else 1)
        found += [(symbol, power * exponent) for symbol, exponent in own]
        expected = False
    if expected:
        raise UnitError(f"'{unit}' is no unit: write 1 for a plain number")
    if inner:
        if not tokens:
            raise UnitError(f"'{unit}' has a bracket that is not closed")
        tokens.pop()
    return found


def _power_behind(tokens: list[str]) -> Fraction:
    """The exponent behind a bracket, which is used up; 1 without one."""
    match = _EXPONENT.fullmatch(tokens[-1]) if tokens else None
    if match is None:
        return Fraction(1)
    tokens.pop()
    return Fraction(match[1])


def _symbol(word: str, unit: str) -> tuple[str, Fraction]:
    match = _SYMBOL.fullmatch(word)
    symbol = match[1] if match else word
    if match is None or symbol not in UNITS or UNITS[symbol][0] not in _DIMENSIONS:
        alike = [known for known in UNITS if known.lower() == symbol.lower()]
        meant = f"; did you mean {alike[0]}?" if alike else ""
        raise UnitError(f"'{word[:20]}' in '{unit}' is no unit{meant}")
    return symbol, Fraction(match[2] or 1)


def factor_of(unit: str) -> float:
    """`unit` in SI; UnitError."""
    factor = 1.0
    for symbol, exponent in _parsed(unit):
        factor *= float(UNITS[symbol][1]) ** float(exponent)
    return factor


def dimension_of_unit(unit: str) -> Dimension:
    """The dimension of `unit`; UnitError."""
    total = NUMBER
    for symbol, exponent in _parsed(unit):
        own = _DIMENSIONS[UNITS[symbol][0]]
        total = tuple(
            a + exponent * b for a, b in zip(total, own + (0,) * (_SIZE - len(own)), strict=True)
        )
    return total


def product(*units: str) -> str:
    """The product of units, simplified: that of `rad/s2` and `s/rad` is `1/s`."""
    exponents: dict[str, Fraction] = {}
    for unit in units:
        for symbol, exponent in _parsed(unit):
            exponents[symbol] = exponents.get(symbol, Fraction(0)) + exponent
    exponents.pop("1", None)
    upper = [_power(s, e) for s, e in exponents.items() if e > 0]
    lower = [_power(s, -e) for s, e in exponents.items() if e < 0]
    below = f"/{lower[0]}" if len(lower) == 1 else f"/({' '.join(lower)})" if lower else ""
    return (" ".join(upper) or "1") + below


def inverse(unit: str) -> str:
    """One over `unit`: `s/rad` of `rad/s`."""
    return " ".join(_power(symbol, -exponent) for symbol, exponent in _parsed(unit))


def _power(symbol: str, exponent: Fraction) -> str:
    if exponent == 1:
        return symbol
    whole = exponent.denominator == 1
    return f"{symbol}{exponent}" if whole else f"{symbol}^{float(exponent):g}"


def words(dimension: Dimension) -> str:
    """`dimension` in SI units."""
    symbols = ("m", "kg", "s", "A", "K", "count")
    upper = [_power(s, e) for s, e in zip(symbols, dimension, strict=True) if e > 0]
    lower = [_power(s, -e) for s, e in zip(symbols, dimension, strict=True) if e < 0]
    known = {(1, 1, -2): "N", (2, 1, -2): "N m", (2, 1, -3): "W", (2, 1, -3, -1): "V"}
    for exponents, unit in known.items():
        if dimension == tuple(map(Fraction, exponents + (0,) * (_SIZE - len(exponents)))):
            return unit
    below = f"/{lower[0]}" if len(lower) == 1 else f"/({' '.join(lower)})" if lower else ""
    return (" ".join(upper) or "1") + below


# -- formulas ----------------------------------------------------------------------------


def dimension_in(formula: Formula, names: Mapping[str, Dimension | None]) -> Dimension | None:
    """The dimension of a formula whose names have those of `names`.

    None where it cannot be told: a zero, or a name of unknown dimension. FormulaError where
    quantities of different dimensions are added or compared.
    """
    return _of(formula.tree, names)


def _of(node: ast.expr, names: Mapping[str, Dimension | None]) -> Dimension | None:
    match node:
        case ast.Constant(value=value):
            return NUMBER if value else None
        case ast.Name(id=name):
            return names.get(name, NUMBER)
        case ast.UnaryOp(operand=operand):
            own = _of(operand, names)
            return NUMBER if isinstance(node.op, ast.Not) else own
        case ast.BinOp():
            return _of_operator(node, names)
        case ast.IfExp():
            _of(node.test, names)
            return _alike([node.body, node.orelse], names)
        case ast.Compare():
            _alike([node.left, *node.comparators], names)
            return NUMBER
        case ast.BoolOp():
            for part in node.values:
                _of(part, names)
            return NUMBER
        case ast.Call(func=ast.Name(id=called), args=args):
            return _of_call(called, args, names)
    return None


def _of_operator(node: ast.BinOp, names: Mapping[str, Dimension | None]) -> Dimension | None:
    if isinstance(node.op, ast.Pow):
        return _power_of(node, names)
    if isinstance(node.op, ast.Add | ast.Sub):
        return _alike([node.left, node.right], names)
    left, right = _of(node.left, names), _of(node.right, names)
    way = 1 if isinstance(node.op, ast.Mult) else -1
    if left is None or right is None:
        return None
    return tuple(a + way * b for a, b in zip(left, right, strict=True))


def _alike(parts: list[ast.expr], names: Mapping[str, Dimension | None]) -> Dimension | None:
    """The one dimension that all `parts` have; FormulaError if they differ."""
    found = [(part, _of(part, names)) for part in parts]
    known = [(part, own) for part, own in found if own is not None]
    for part, own in known[1:]:
        if own != known[0][1]:
            first = words(known[0][1])
            message = f"units do not match: {first} and {words(own)} stand together"
            raise FormulaError(message, *place(part))
    return known[0][1] if known else None


def _power_of(node: ast.BinOp, names: Mapping[str, Dimension | None]) -> Dimension | None:
    base, exponent = _of(node.left, names), node.right
    way = 1
    if isinstance(exponent, ast.UnaryOp) and isinstance(exponent.op, ast.USub):
        way, exponent = -1, exponent.operand
    if isinstance(exponent, ast.Constant) and isinstance(exponent.value, int | float):
        if base is None:
            return None
        power = way * Fraction(exponent.value).limit_denominator(1000)
        found = tuple(power * own for own in base)
        if max(map(abs, found)) > LARGEST_EXPONENT:
            message = f"a unit to a power of more than {LARGEST_EXPONENT}"
            raise FormulaError(message, *place(node))
        return found
    _plain(node.left, base)
    _plain(node.right, _of(node.right, names))
    return NUMBER


def _plain(node: ast.expr, own: Dimension | None) -> None:
    """FormulaError unless `node` is a plain number."""
    if own is not None and own != NUMBER:
        message = f"a number without unit is expected here, found {words(own)}"
        raise FormulaError(message, *place(node))


def _plain_all(nodes: list[ast.expr], names: Mapping[str, Dimension | None]) -> Dimension:
    """The dimension of a number; FormulaError unless all `nodes` have it."""
    for node in nodes:
        _plain(node, _of(node, names))
    return NUMBER


_TIME, _RATE = dimension_of_unit("s"), dimension_of_unit("Hz")
_TEMPERATURE = dimension_of_unit("K")


def _of_call(
    called: str, args: list[ast.expr], names: Mapping[str, Dimension | None]
) -> Dimension | None:
    first = _of(args[0], names)
    match called:
        case "min" | "max":
            return _alike(args, names)
        case "abs" | "before" | "first":
            return first
        case "sqrt":
            return None if first is None else tuple(own / 2 for own in first)
        case "sign" | "side":
            return _plain_all(args[1:], names)
        case "lag" | "delayed" | "swing":
            _expect(args[1], _of(args[1], names), _RATE if called == "swing" else _TIME)
            _plain_all(args[2:], names)
            return first
        case "play":
            _plain_all(args[2:], names)
            return _alike(args[:2], names)
        case "presliding" | "atan2":
            _alike(args, names)
            return NUMBER
        case "since_change":
            return _TIME
        case "rate":
            if first is None:
                return None
            return tuple(a - b for a, b in zip(first, _TIME, strict=True))
        case "kelvin":
            _expect(args[0], first, _TEMPERATURE)
            return _TEMPERATURE
    _plain(args[0], first)
    return NUMBER


def _expect(node: ast.expr, own: Dimension | None, wanted: Dimension) -> None:
    if own is not None and own != wanted:
        message = f"{words(wanted)} is expected here, found {words(own)}"
        raise FormulaError(message, *place(node))
