"""Summary of a run: the table of its moves, its outcome, and what went wrong."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mopro.cli.terminal.options import STANDARD
from mopro.cli.terminal.say import say, say_findings

if TYPE_CHECKING:
    from mopro.program import Program
    from mopro.recording import MoveReport, Run

_MOST_ROWS = 40


@dataclass(frozen=True)
class Written:
    """The recording of a run; `replaced` if another one stood there."""

    out: Path
    replaced: bool

    def __str__(self) -> str:
        return f"Recording: {self.out}" + (" (replaced the one before)" if self.replaced else "")


def tell_trouble(program: Program, trouble: str | None) -> None:
    """Print what went wrong with a run, if anything, to stderr."""
    if trouble:
        say(f"{program.source.name}: {trouble} [run-failed]", err=True)


def tell(run: Run, program: Program, written: Written, for_s: float | None, as_json: bool) -> None:
    """Print the summary to stdout, and findings to stderr; trouble has been told before.

    The summary goes to stderr if stdout has the recording.
    """
    from mopro.errors import Diagnostic, Severity
    from mopro.recording.run import outcome, stall_findings

    if as_json:
        more = {"recording": str(written.out), "replaced": written.replaced}
        say(json.dumps({**run.as_json(), **more}, indent=1))
    elif written.out == STANDARD:
        say(outcome(run), err=True)
    else:
        _print_moves(run.moves)
        say(outcome(run))
        say(str(written))
    if not run.trouble and not run.complete and run.trip is None:
        say(f"{program.source.name}: {_cut_text(run, for_s)}", err=True)
    for span, message, hint in stall_findings(run, program):
        finding = Diagnostic("stall", message, span, Severity.ERROR, hint)
        say_findings(finding.render(program.source), err=True)


def _cut_text(run: Run, for_s: float | None) -> str:
    """Why a run ended before its program, and how to change that if it was not asked for."""
    why = "the program loops for ever" if run.loops_forever else "the program had not ended"
    if for_s is not None:
        return f"{why}: stopped after {run.duration_s:g} s, as --for says"
    hint = "change that with --for, for example --for 10min"
    return f"{why}: stopped after {run.duration_s:g} s; {hint}"


def _print_moves(moves: Sequence[MoveReport]) -> None:
    """A table of the moves for each unit of length, those of one statement in one row."""
    from mopro.cli.terminal.table import print_table
    from mopro.recording.moves import folded, folded_columns

    for unit in dict.fromkeys(move.unit for move in moves):
        rows = folded(move for move in moves if move.unit == unit)
        styles = ["red" if row.worst.slipped else "" for row in rows]
        print_table(folded_columns(unit), [row.cells for row in rows], _MOST_ROWS, styles, 80)
