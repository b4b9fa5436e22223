"""Recordings as `mopro run` writes them, over no other file, and the summary of the run."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.options import STANDARD
from mopro.cli.say import print_table, say, say_findings, say_json
from mopro.errors import DataError, Diagnostic, Severity

if TYPE_CHECKING:
    from mopro.link.writer import Writer
    from mopro.program import Program
    from mopro.recording import FileSink, Header, MoveReport, Run
    from mopro.recording.record import Columns


# Chunks of a recording that may wait: a minute of samples.
_MOST_CHUNKS = 4
# The end of a recording, its durable copy on the disk, takes at most so long (s).
_FINISHED_WITHIN_S = 30.0


def replaces_recording(out: Path, force: bool) -> bool:
    """True if `out` is a recording, which a run would replace.

    UsageError if it is another file with something in it, unless `force` is given.
    """
    if out == STANDARD or not out.is_file() or out.stat().st_size == 0:
        return False
    from mopro.recording.reading import is_recording

    if is_recording(out):
        return True
    if not force:
        message = f"{out} is there and is no recording of mopro"
        raise click.UsageError(f"{message}: choose another name for --out, or add --force")
    return False


@contextmanager
def recording_sink(out: Path, header: Header, apart: bool = False) -> Iterator[FileSink]:
    """A sink for `out`; for `-` the recording is written as CSV when it is whole.

    With `apart` the file is written by a thread of its own, and holds up nobody who writes to it.
    """
    from mopro.recording import open_sink

    opened = _apart if apart else open_sink
    if out != STANDARD:
        with opened(out, header) as sink:
            yield sink
        return
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "run.csv"
        with opened(whole, header) as sink:
            yield sink
        with open(whole, "rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)
        sys.stdout.flush()


class _Apart:
    """A FileSink behind a writer."""

    def __init__(self, writer: Writer[FileSink], header: Header) -> None:
        self._writer = writer
        self.header = header
        self.run: Run | None = None

    def write(self, columns: Columns) -> None:
        self._writer.put(lambda sink: sink.write(columns))

    def finish(self, sink: FileSink) -> None:
        sink.header, sink.run = self.header, self.run


class _Abandoned(DataError):
    """The recording shall not be kept."""


@contextmanager
def _apart(out: Path, header: Header) -> Iterator[FileSink]:
    """As open_sink, in a thread of its own."""
    from mopro.link.writer import Writer
    from mopro.recording import open_sink

    writer = Writer("the recording", open_sink(out, header), _MOST_CHUNKS)
    apart = _Apart(writer, header)
    try:
        yield apart
    except BaseException:
        with suppress(DataError):
            writer.put(_abandon)
            writer.close()
        raise
    writer.put(apart.finish)
    writer.close(_FINISHED_WITHIN_S)


def _abandon(sink: FileSink) -> None:
    raise _Abandoned("the run has not begun")


# -- the summary of a run ---------------------------------------------------------------------
# Summary of a run: the table of its moves, its outcome, and what went wrong.

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
    from mopro.recording.run import outcome, stall_findings

    if as_json:
        more = {"recording": str(written.out), "replaced": written.replaced}
        say_json({**run.as_json(), **more})
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
    from mopro.recording.moves import folded, folded_columns

    for unit in dict.fromkeys(move.unit for move in moves):
        rows = folded(move for move in moves if move.unit == unit)
        styles = ["red" if row.worst.slipped else "" for row in rows]
        print_table(folded_columns(unit), [row.cells for row in rows], _MOST_ROWS, styles, 80)
