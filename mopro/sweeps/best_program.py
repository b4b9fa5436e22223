"""The program of a best point as a `.CMD` file, which says in comments how it was chosen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from mopro.program import Program, ir
from mopro.program.statements import statement
from mopro.sweeps.drawn import Draws
from mopro.sweeps.optimum import Goal, Optimum
from mopro.sweeps.tasks import Subject
from mopro.tomlfile import shown

_WIDTH = 72


def program_text(subject: Subject, goal: Goal, found: Optimum, draws: Draws | None) -> bytes:
    """The file: comments, and the program as it is written, with the settings of `found`.

    What is varied beside settings of the program (a payload, the machine) stands in the comments.
    """
    program = subject.base.program
    best = subject.variant((*found.values, *(n.varied.levels[0] for n in subject.uncertain)))
    lines = [f"; {line}" for line in _comments(subject, goal, found, draws)]
    lines += _lines(program, best.program)
    end = program.source.line_end
    text = "".join(line + end for line in lines)
    return replace(program.source, text=text).encoded


def _comments(subject: Subject, goal: Goal, found: Optimum, draws: Draws | None) -> Iterator[str]:
    base, row = subject.base, found.row
    aim = "largest" if goal.largest else "least"
    yield f"mopro optimize of {_plain(base.program.name)}"
    yield f"figure: {aim} {goal.column}, {row[goal.column]:.6g}, of {found.runs} points"
    yield f"machine: {_plain(base.machine.name)}, verdict {base.machine.verdict or 'not stated'}"
    if base.payload_kg:
        yield f"payload: {base.payload_kg:g} kg"
    for each in subject.varied:
        yield f"{each.name} = {row[each.column]} {each.unit}".rstrip()
    for bound in goal.bounds:
        yield f"limit: {_plain(bound.text)}, here {row[bound.column]:.6g}"
    if draws is None or found.verified is None:
        yield "draws: none, the machine is taken as known"
        return
    numbers = ", ".join(number.varied.name for number in subject.uncertain)
    yield f"draws: {draws.count} machines, seed {draws.seed}, by {_plain(numbers)}"
    missing = found.verified.missing
    yield f"fresh draws: {missing.count} of {missing.total} stall or miss a limit"
    yield f"bound: at most {found.verified.at_most:.3%} do (95 % confidence), asked {goal.risk:.3%}"


def _lines(before: Program, after: Program) -> Iterator[str]:
    """The lines of `before`, those whose statement has another setting written anew."""
    old, new = _by_line(before.ops), _by_line(after.ops)
    for number, line in enumerate(before.source.lines, start=1):
        if old.get(number) == new.get(number):
            yield line
            continue
        *first, last = (statement(op) for op in new[number])
        yield from first
        _, mark, comment = line.partition(";")
        yield f"{last}  ;{comment}" if mark else last


def _by_line(ops: Sequence[ir.Op]) -> dict[int, list[ir.Op]]:
    found: dict[int, list[ir.Op]] = {}
    for op in ops:
        found.setdefault(op.span.line, []).append(op)
    return found


def _plain(text: str) -> str:
    """`text` in characters that every encoding of a program has."""
    return shown(text, _WIDTH).encode("ascii", "backslashreplace").decode()
