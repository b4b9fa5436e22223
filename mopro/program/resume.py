"""Beginning a program at a later line, with the settings that lead to it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mopro.errors import Diagnostic, SourceError
from mopro.language import ast
from mopro.program import Program, ir
from mopro.program.text import statement
from mopro.source import Span

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
