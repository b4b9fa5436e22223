"""`mopro run`."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.link import baud_option, connected_session, dialect_option, trace_option
from mopro.cli.live import Live, live_run
from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import (
    STANDARD,
    OutputFile,
    Quantity,
    for_option,
    grammar_option,
    machine_option,
    payload_option,
    program_argument,
    tell_of_runs,
)
from mopro.cli.outputs import DrawingSink, claimed, drawn, keep_inputs, machine_file, page_bytes
from mopro.cli.program_files import compiled_program, refuse_unrunnable
from mopro.cli.progress import in_motion, length_unit, simulated
from mopro.cli.recordings import Written, recording_sink, replaces_recording, tell, tell_trouble
from mopro.cli.say import say, say_if_taken

if TYPE_CHECKING:
    from mopro.emulator import Emulator
    from mopro.link import SerialBackend
    from mopro.machine import Machine
    from mopro.program import Program
    from mopro.recording import Header, Run, Sink
    from mopro.recording.record import Columns

DEFAULT_OUT = "run.parquet"


@click.command()
@program_argument()
@click.option("--emulate", is_flag=True, help="Run on the emulated machine.")
@click.option(
    "--port", metavar="URL", help="Run on the controller there (/dev/ttyUSB0, socket://)."
)
@machine_option()
@for_option()
@payload_option()
@click.option(
    "--rate",
    type=Quantity("frequency", "Hz", positive=True, says_unit=False),
    default=2000.0,
    show_default=True,
    metavar="HZ",
    help="Samples per second of the recording.",
)
@click.option(
    "--settle",
    "settle_s",
    type=Quantity("time", "s"),
    default="0.5s",
    show_default=True,
    metavar="DURATION",
    help="Record for so long after the last move of a program that ends.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the random numbers.")
@click.option(
    "--out",
    type=OutputFile(".parquet", ".csv", ".npz", standard=True),
    default=DEFAULT_OUT,
    show_default=True,
    help="The recording: .parquet, .csv, .npz, or - for CSV on standard output.",
)
@click.option(
    "--columns",
    metavar="NAME,...",
    callback=lambda context, option, text: tuple(
        name.strip() for name in (text or "").split(",") if name.strip()
    ),
    help="Store these columns only, and time_s; 'position_*' is that of each axis.",
)
@click.option("--force", is_flag=True, help="Let --out replace a file that is no recording.")
@click.option("--plot", type=OutputFile(".png", ".svg", ".pdf"), help="A picture of the run.")
@click.option("--report", type=OutputFile(".html"), help="A page about the run.")
@click.option("--live", is_flag=True, help="Show the run in a browser as it goes, in real time.")
@dialect_option()
@baud_option()
@trace_option()
@click.option("--from-line", type=click.IntRange(1), help="With --port: begin at this line.")
@click.option("--yes", is_flag=True, help="Do not ask before a run that begins at a line.")
@click.option(
    "--deadline",
    type=Quantity("time", "s", positive=True),
    help="With --port: stop the machine after this much time by this computer's clock.",
)
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(**options: Any) -> int:
    """Run a program and record the motion of the machine.

    FILE may be - for standard input. --out replaces a recording, and no other file. Exits
    with 1 if the motor stalls, runs into a limit switch or becomes too hot, or if a run on a
    controller fails.

    Example: mopro run programs/LVDT3.CMD --emulate --payload 5lb --plot lvdt3.png
    """
    asked = _Asked(**options)
    asked.check()
    replaces = replaces_recording(asked.out, asked.force)
    program = compiled_program(asked.file, asked.grammar)
    pictures = _Pictures(asked.plot, asked.report, program, asked.grammar)
    with ExitStack() as outer, ExitStack() as files:
        files.enter_context(claimed(asked.plot, asked.report))
        plant, program = _loaded(asked, program)
        page = files.enter_context(live_run(program, plant, asked.for_s)) if asked.live else None
        backend: Emulator | SerialBackend
        reporting: AbstractContextManager[None] = nullcontext()
        if asked.port is None:
            backend = _emulated(files, asked, plant, page, pictures)
        else:
            backend = _linked(outer, files, asked, plant, page)
            reporting = backend.signals.released_in_time()
        run = _recorded(backend, program, asked, pictures, reporting)
        run = _closed(files, run, program, page)
        all_drawn = pictures.draw(backend.header(program), run, plant, asked.machine)
        tell(run, program, Written(asked.out, replaces), asked.for_s, asked.as_json)
    return EXIT_FAILED if run.stalled or run.trip or run.trouble or not all_drawn else 0


@dataclass(frozen=True)
class _Asked:
    """The arguments of the command; `payload` in kg, `rate` in Hz, `deadline` in s."""

    file: str
    emulate: bool
    port: str | None
    machine: str
    for_s: float | None
    payload: float
    rate: float
    settle_s: float
    seed: int
    out: Path
    columns: tuple[str, ...]
    force: bool
    plot: Path | None
    report: Path | None
    live: bool
    dialect: str
    baud: int | None
    trace: Path | None
    from_line: int | None
    yes: bool
    deadline: float | None
    grammar: str
    as_json: bool

    def check(self) -> None:
        """UsageError for an output that is an input, two back ends or none, and the like.

        Options of the other back end are refused, and two standard outputs.
        """
        outputs = [
            ("--out", self.out), ("--plot", self.plot), ("--report", self.report),
            ("--trace", self.trace),
        ]  # fmt: skip
        inputs = [
            ("FILE", self.file), ("--machine", machine_file(self.machine)),
            ("--dialect", self.dialect),
        ]  # fmt: skip
        keep_inputs(outputs, inputs)
        if self.emulate == (self.port is not None):
            raise click.UsageError("say what to run on: --emulate or --port URL, one of them")
        if self.out == STANDARD and self.as_json:
            raise click.UsageError("--json and --out - would both write to standard output")
        if self.emulate:
            _only_with("--port", "baud", "trace", "from_line", "deadline")
        else:
            _only_with("--emulate", "payload", "rate", "seed", "columns")


def _loaded(asked: _Asked, program: Program) -> tuple[Machine, Program]:
    """The machine, and what of the program is to run; on a controller only what it can run."""
    from mopro.machine import load_machine

    plant = load_machine(asked.machine)
    if asked.port is None:
        tell_of_runs(plant)
        return plant, program
    program = _from_line(program, asked.from_line, asked.yes)
    refuse_unrunnable(program, asked.machine, asked.for_s)
    return plant, program


def _emulated(
    files: ExitStack, asked: _Asked, plant: Machine, page: Live | None, pictures: _Pictures
) -> Emulator:
    """The emulator of `plant`.

    `files` holds the signals of a live `page`, which shows what the pictures take.
    """
    from mopro.emulator import Emulator

    if page is not None:
        pictures.show(page)
        files.enter_context(page.signals)
        files.enter_context(page.signals.raised())
    return Emulator(plant, asked.payload, asked.rate, asked.seed)


def _linked(
    outer: ExitStack, files: ExitStack, asked: _Asked, plant: Machine, page: Live | None
) -> SerialBackend:
    """The controller at the end of the link.

    `outer` holds signals back until the run has been reported, `files` the open port. The
    deadline counts from before the port is opened. `page` shows the samples.
    """
    from mopro.link import SerialBackend, Signals
    from mopro.link.transport import TracedPort

    begun_s = time.monotonic()
    signals = outer.enter_context(page.signals if page else Signals())
    link = connected_session(str(asked.port), asked.dialect, asked.baud, asked.trace)
    session = files.enter_context(link)
    return SerialBackend(
        session,
        plant,
        deadline_s=asked.deadline,
        begun_s=begun_s,
        signals=signals,
        warn=lambda text: say_if_taken(f"warning: {text} [no-heartbeat]"),
        seen=page.see if page else lambda row: None,
        hold=session.port.hold if isinstance(session.port, TracedPort) else lambda: None,
    )


def _recorded(
    backend: Emulator | SerialBackend,
    program: Program,
    asked: _Asked,
    pictures: _Pictures,
    reporting: AbstractContextManager[None],
) -> Run:
    """The run of `program` on either back end, its recording in --out, its progress shown.

    A controller's run is reported even if its recording cannot be written. `reporting`: a context
    that is entered after the run until the command ends. What went wrong is told before anything
    else is written.
    """
    from mopro.errors import DataError
    from mopro.recording import ChosenColumns, UnknownColumn

    header, linked = backend.header(program), asked.port is not None
    run = None
    progress = in_motion(length_unit(program, backend.machine)) if linked else simulated()
    with progress as show:
        try:
            with recording_sink(asked.out, header, apart=linked) as sink:
                stored = ChosenColumns(sink, asked.columns) if asked.columns else sink
                beside = pictures.beside(stored)
                run = backend.run(program, beside, asked.for_s, asked.settle_s, show)
                click.get_current_context().with_resource(reporting)
                tell_trouble(program, run.trouble)
                sink.header, sink.run = header.after(run), run
        except UnknownColumn as error:
            raise click.UsageError(f"--columns: {error}") from error
        except DataError as error:
            if run is None or not linked:
                raise
            return _worse(run, program, f"the run has ended, but its recording is lost: {error}")
    return run


def _worse(run: Run, program: Program, trouble: str) -> Run:
    """The run with more that went wrong, which is told."""
    tell_trouble(program, trouble)
    return replace(run, trouble="\n".join(filter(None, (run.trouble, trouble))))


def _closed(files: ExitStack, run: Run, program: Program, page: Live | None) -> Run:
    """The run after its port and trace are closed, and its page told how it ended.

    A trace that has not been written whole is trouble.
    """
    from mopro.errors import DataError

    if page is not None:
        page.end(run)
    try:
        files.close()
    except DataError as error:
        run = _worse(run, program, str(error))
    return run


def _only_with(other: str, *names: str) -> None:
    """Refuse options that only apply with `other`."""
    context = click.get_current_context()
    for name in names:
        if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name.replace('_', '-')} goes with {other} only")


def _from_line(program: Program, line: int | None, yes: bool) -> Program:
    """The program from `line` on, after its settings are shown and confirmed; all of it if None."""
    if line is None:
        return program
    from mopro.program.statements import resume

    resumed = resume(program, line)
    say(f"Begin at line {resumed.line}; in force there, without any motion:", err=True)
    for text in resumed.settings:
        say(f"  {text}", err=True)
    say("The motor is assumed to stand where the program expects it to.", err=True)
    if not yes:
        click.confirm("Start?", abort=True, err=True)
    return resumed.program


class _Pictures:
    """The plot and the report of a run, drawn when its recording has been written."""

    def __init__(
        self, plot: Path | None, report: Path | None, program: Program, grammar: str
    ) -> None:
        from mopro.recording.envelope import Envelopes

        self._plot = plot
        self._report = report
        self._program = program
        self._grammar = grammar
        self._envelopes = Envelopes()
        self._drawing = DrawingSink(self._envelopes)
        self._live: Sink | None = None

    def show(self, page: Live) -> None:
        """Show the samples on `page` too, in real time."""
        from mopro.viewer.live import Paced

        self._live = Paced(page)

    def beside(self, sink: Sink) -> Sink:
        if self._live is not None:
            sink = _Tee(sink, self._live)
        return _Tee(sink, self._drawing) if self._plot or self._report else sink

    def draw(self, header: Header, run: Run, plant: Machine, machine: str) -> bool:
        """Draw the outputs that were asked for; False if one of them fails."""

        def figure(form: str) -> bytes:
            from mopro.plot import figure_bytes
            from mopro.recording.figure import draw

            self._drawing.check()
            title = f"{header.program} on {header.machine}"
            return figure_bytes(draw(self._envelopes, title, run), form)

        def page(form: str) -> bytes:
            from mopro.lint import Settings, lint
            from mopro.viewer.run import run_page, run_view

            self._drawing.check()
            program = self._program
            findings = lint(program.source, Settings(machine, header.payload_kg, self._grammar))
            view = run_view(self._envelopes, run, program, plant, findings)
            return page_bytes(run_page(header, view, run, plant))

        # A list, so that both are drawn even if the first fails.
        return all([drawn(self._plot, figure), drawn(self._report, page)])


@dataclass(frozen=True)
class _Tee:
    first: Sink
    second: Sink

    def write(self, columns: Columns) -> None:
        self.first.write(columns)
        self.second.write(columns)
