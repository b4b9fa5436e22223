"""`mopro run`."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import OutputFile, Quantity, grammar_option, program_argument
from mopro.cli.programs import compiled_program

if TYPE_CHECKING:
    from mopro.program import Program
    from mopro.recording import Header, Run, Sink
    from mopro.recording.record import Columns

DEFAULT_OUT = "run.parquet"
_MOST_PLOTTED = 200_000
_MOST_ROWS = 40


@click.command()
@program_argument()
@click.option("--emulate", is_flag=True, help="Run on the emulated machine.")
@click.option("--machine", default="chow1992", show_default=True, help="Built-in name or file.")
@click.option(
    "--for",
    "for_s",
    type=Quantity("time", "s", positive=True),
    metavar="DURATION",
    help="Stop after this much time (10s, 2min); 60 s for a program that loops for ever.",
)
@click.option(
    "--payload",
    type=Quantity("mass", "kg"),
    default=0.0,
    metavar="MASS",
    help="What rides on the motor (5lb, 2kg).",
)
@click.option(
    "--rate",
    type=Quantity("frequency", "Hz", positive=True),
    default=2000.0,
    show_default=True,
    metavar="HZ",
    help="Samples per second of the recording.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="For what is random.")
@click.option(
    "--out",
    type=OutputFile(".parquet", ".csv", ".npz"),
    default=DEFAULT_OUT,
    show_default=True,
    help="The recording: .parquet, .csv or .npz.",
)
@click.option("--plot", type=OutputFile(".png", ".svg", ".pdf"), help="A picture of the run.")
@click.option("--report", type=OutputFile(".html"), help="A page about the run.")
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    file: str,
    emulate: bool,
    machine: str,
    for_s: float | None,
    payload: float,
    rate: float,
    seed: int,
    out: Path,
    plot: Path | None,
    report: Path | None,
    grammar: str,
    as_json: bool,
) -> int:
    """Run a program and record what the machine does.

    Exits with 1 if the motor stalls, runs into a limit switch or becomes too hot.

    Example: mopro run programs/LVDT3.CMD --emulate --payload 5lb --plot lvdt3.png
    """
    if not emulate:
        raise click.UsageError("say what to run on: --emulate")
    from mopro.emulator import Emulator
    from mopro.machine import load_machine
    from mopro.recording import open_sink

    program = compiled_program(file, grammar)
    emulator = Emulator(load_machine(machine), payload, rate, seed)
    header = emulator.header(program)
    with ExitStack() as files:
        sink = files.enter_context(open_sink(out, header))
        pictures = _Pictures(plot, report, files) if plot or report else None
        run = emulator.run(program, pictures.beside(sink) if pictures else sink, for_s)
        if pictures:
            pictures.draw(header, run)
    _tell(run, program, out, as_json)
    return EXIT_FAILED if run.stalled or run.trip else 0


class _Pictures:
    """The plot and the report of a run, their places claimed before it starts."""

    def __init__(self, plot: Path | None, report: Path | None, files: ExitStack) -> None:
        from mopro.recording import MemorySink
        from mopro.recording.atomic import written_beside

        self._plot = plot
        self._plot_draft = files.enter_context(written_beside(plot)) if plot else None
        self._report_draft = files.enter_context(written_beside(report)) if report else None
        self._memory = MemorySink(_MOST_PLOTTED)

    def beside(self, sink: Sink) -> Sink:
        return _Tee(sink, self._memory)

    def draw(self, header: Header, run: Run) -> None:
        from mopro.plot import plot_recording, report_page

        recording = self._memory.recording(header, run)
        if self._plot and self._plot_draft:
            plot_recording(recording).savefig(self._plot_draft, format=self._plot.suffix[1:])
        if self._report_draft:
            self._report_draft.write_text(report_page(recording, run), encoding="utf-8")


@dataclass(frozen=True)
class _Tee:
    first: Sink
    second: Sink

    def write(self, columns: Columns) -> None:
        self.first.write(columns)
        self.second.write(columns)


def _tell(run: Run, program: Program, out: Path, as_json: bool) -> None:
    """The summary on stdout, and on stderr what the person should know about it."""
    from mopro.cli.table import print_table
    from mopro.errors import Diagnostic, Severity
    from mopro.recording.table import MOVE_COLUMNS, move_cells, outcome, stalls

    if as_json:
        click.echo(json.dumps({**run.as_json(), "recording": str(out)}, indent=1))
    else:
        print_table(MOVE_COLUMNS, map(move_cells, run.moves), _MOST_ROWS)
        click.echo(outcome(run))
        click.echo(f"Recording: {out}")
    if not run.complete and run.trip is None:
        why = "the program loops for ever" if run.loops_forever else "the program had not ended"
        hint = "change that with --for, for example --for 10min"
        click.echo(
            f"{program.source.name}: {why}: stopped after {run.duration_s:g} s; {hint}", err=True
        )
    for span, message in stalls(run, program):
        finding = Diagnostic("stall", message, span, Severity.ERROR)
        click.echo(finding.render(program.source), err=True)
