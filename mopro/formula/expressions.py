"""The language of formulas: a subset of Python's expressions, parsed and checked node by node.

A text is parsed by `ast` and every node of the tree must be one of those listed here. The text
is never compiled or executed; `evaluate` and `bytecode` walk the tree.
"""

from __future__ import annotations

import ast
import copy
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property

MOST_CHARACTERS = 500
MOST_LEVELS = 40
LARGEST = 1e30
PI = "pi"
ZERO_C_IN_K = 273.15

# Functions of numbers, with the number of their arguments (-1: two or more).
FUNCTIONS = {
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2,
    "sinh": 1, "cosh": 1, "tanh": 1, "exp": 1, "log": 1, "sqrt": 1,
    "abs": 1, "sign": 1, "min": -1, "max": -1, "kelvin": 1,
}  # fmt: skip
# Functions of a whole signal in time.
SIGNALS = {
    "lag": 2, "delayed": 2, "play": 2, "presliding": 2, "swing": 3,
    "side": 1, "before": 1, "since_change": 1, "rate": 1, "first": 1,
}  # fmt: skip
# Those that may have one argument more.
_OPTIONAL = {"side", "play"}
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)


class FormulaError(ValueError):
    """A fault of a formula; `start` and `end` are the columns (from 0) that it stands in."""

    def __init__(self, message: str, start: int = 0, end: int | None = None) -> None:
        super().__init__(message)
        self.start = start
        self.end = start + 1 if end is None else end


@dataclass(frozen=True)
class Formula:
    """A formula whose tree has only nodes of the language; `names` are those it refers to."""

    text: str
    tree: ast.expr = field(compare=False)
    names: frozenset[str]

    def only_within(self, name: str, places: Collection[str]) -> bool:
        """True if `name` is mentioned, each time in a divisor ("/") or function of `places`."""
        every = list(_surroundings(self.tree, name, frozenset()))
        return bool(every) and all(own.intersection(places) for own in every)

    @cached_property
    def of_signals(self) -> bool:
        """True if it needs the signal in time and not its value at one moment alone."""
        return any(called in SIGNALS for called in _called(self.tree))


def _surroundings(tree: ast.AST, name: str, around: frozenset[str]) -> Iterator[frozenset[str]]:
    """The functions, and "/" for a divisor, that each mention of `name` stands in."""
    if isinstance(tree, ast.Name):
        if tree.id == name:
            yield around
    elif isinstance(tree, ast.BinOp):
        yield from _surroundings(tree.left, name, around)
        divisor = {"/"} if isinstance(tree.op, ast.Div) else set()
        yield from _surroundings(tree.right, name, around | divisor)
    elif isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name):
        for argument in tree.args:
            yield from _surroundings(argument, name, around | {tree.func.id})
    else:
        for child in ast.iter_child_nodes(tree):
            yield from _surroundings(child, name, around)


def parse(text: str) -> Formula:
    """The formula that `text` is; FormulaError at the first fault."""
    if len(text) > MOST_CHARACTERS:
        raise FormulaError(f"a formula of more than {MOST_CHARACTERS} characters")
    _check_depth(text)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the parser, about odd literals
            tree = ast.parse(text, mode="eval").body
    except SyntaxError as error:
        at = max((error.offset or 1) - 1, 0)
        raise FormulaError(f"no formula: {error.msg}", min(at, len(text))) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise FormulaError("no formula: it cannot be parsed") from error
    names = frozenset(_checked(tree, 0))
    return Formula(text, tree, names - {PI})


def substituted(formula: Formula, names: Mapping[str, Formula]) -> Formula:
    """`formula` with other formulas in the place of some of its names."""

    class Replace(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            return names[node.id].tree if node.id in names else node

        def visit_Call(self, node: ast.Call) -> ast.expr:
            args = [self.visit(part) for part in node.args]
            return ast.copy_location(ast.Call(node.func, args, []), node)

    tree: ast.expr = Replace().visit(copy.deepcopy(formula.tree))
    inner = frozenset().union(*(names[name].names for name in formula.names & names.keys()))
    return Formula(ast.unparse(tree), tree, (formula.names - names.keys()) | inner)


def without_products(formula: Formula, zeros: Collection[str]) -> Formula:
    """`formula` without the summands that are a product with one of `zeros`, which are 0."""
    tree = _without(formula.tree, zeros)
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return Formula(ast.unparse(tree), tree, formula.names & names)


def _without(node: ast.expr, zeros: Collection[str]) -> ast.expr:
    """The sum that `node` is, without those summands; the constant 0 if none is left."""
    match node:
        case ast.Name(id=name) if name in zeros:
            return ast.Constant(0.0)
        case ast.BinOp(left=left, op=ast.Mult() as op, right=right):
            parts = _without(left, zeros), _without(right, zeros)
            return next(filter(_is_zero, parts), ast.BinOp(parts[0], op, parts[1]))
        case ast.BinOp(left=left, op=ast.Add() as op, right=right):
            one, other = _without(left, zeros), _without(right, zeros)
            return other if _is_zero(one) else one if _is_zero(other) else ast.BinOp(one, op, other)
    return node


def factor_beside(formula: Formula, name: str) -> Formula | None:
    """What `name` is multiplied by in a formula `name * ...`; None for any other formula."""
    match formula.tree:
        case ast.BinOp(left=ast.Name(id=found), op=ast.Mult(), right=right) if found == name:
            names = {node.id for node in ast.walk(right) if isinstance(node, ast.Name)}
            return Formula(ast.unparse(right), right, formula.names & names)
    return None


def _is_zero(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value == 0


def check_names(formula: Formula, known: Iterable[str]) -> None:
    """FormulaError at the first name that is not among `known`."""
    names = {*known, PI}
    for node in ast.walk(formula.tree):
        if isinstance(node, ast.Name) and node.id not in names | FUNCTIONS.keys() | SIGNALS.keys():
            near = get_close_matches(node.id, names, n=1)
            more = f"did you mean {near[0]}? " if near else ""
            listed = ", ".join(sorted(names)[:30])
            message = f"unknown name {node.id[:40]}: {more}known are {listed}"
            raise FormulaError(message, *place(node))


def place(node: ast.expr) -> tuple[int, int]:
    """First and last column of a node, from 0."""
    return node.col_offset, node.end_col_offset or node.col_offset + 1


def _check_depth(text: str) -> None:
    """Refuse deep nesting before the parser spends a stack on it."""
    depth = 0
    for at, character in enumerate(text):
        depth += (character in "([{") - (character in ")]}")
        if depth > MOST_LEVELS:
            raise FormulaError(f"nested more than {MOST_LEVELS} levels deep", at)


def _called(tree: ast.expr) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            yield node.func.id


def _checked(node: ast.expr, depth: int) -> Iterator[str]:
    """Names in the tree of `node`; FormulaError for anything that is not of the language."""
    if depth > MOST_LEVELS:
        raise FormulaError(f"nested more than {MOST_LEVELS} levels deep", *place(node))
    if isinstance(node, ast.Name):
        if node.id in FUNCTIONS or node.id in SIGNALS:
            raise FormulaError(f"{node.id} is a function: write {node.id}(...)", *place(node))
        yield node.id
        return
    for part in _parts(node):
        yield from _checked(part, depth + 1)


def _parts(node: ast.expr) -> list[ast.expr]:
    """The operands of a node that the language has."""
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as number):
            # An integer is compared as it is: one of 310 digits is no float.
            if not abs(number) <= LARGEST:
                message = f"a number that is too large, expected one of at most {LARGEST:g}"
                raise FormulaError(message, *place(node))
            return []
        case ast.BinOp(op=op) if isinstance(op, _OPERATORS):
            return [node.left, node.right]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() | ast.Not()):
            return [node.operand]
        case ast.BoolOp():
            return node.values
        case ast.Compare(ops=[op]) if isinstance(op, _COMPARISONS):
            return [node.left, *node.comparators]
        case ast.IfExp():
            return [node.test, node.body, node.orelse]
        case ast.Call():
            return _arguments(node)
    hint = "a formula has numbers, names, + - * / **, comparisons, and functions"
    raise FormulaError(f"{_kind(node)} is not of the language: {hint}", *place(node))


def _arguments(node: ast.Call) -> list[ast.expr]:
    known = FUNCTIONS | SIGNALS
    if not isinstance(node.func, ast.Name) or node.func.id not in known:
        name = node.func.id if isinstance(node.func, ast.Name) else "this"
        listed = ", ".join(sorted(known))
        raise FormulaError(f"{name[:40]} is no function of formulas: there are {listed}",
                           *place(node.func))  # fmt: skip
    wanted, found = known[node.func.id], len(node.args)
    more = found == wanted + 1 and node.func.id in _OPTIONAL
    if node.keywords or not (more or (found == wanted if wanted > 0 else found >= 2)):
        many = f"{wanted}" if wanted > 0 else "two or more"
        if node.func.id in _OPTIONAL:
            many += f" or {wanted + 1}"
        message = f"{node.func.id} takes {many} argument{'' if many == '1' else 's'}"
        raise FormulaError(f"{message}, found {found + len(node.keywords)}", *place(node))
    return node.args


def _kind(node: ast.expr) -> str:
    words = {
        ast.Attribute: "a dot", ast.Subscript: "an index", ast.Lambda: "lambda",
        ast.Constant: "this value", ast.Compare: "a chain of comparisons",
    }  # fmt: skip
    return words.get(type(node), f"this ({type(node).__name__})")
