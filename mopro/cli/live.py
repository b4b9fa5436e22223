"""Live pages of `mopro run --live` and `mopro serve --web`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING

import click

from mopro.cli.outputs import DrawingSink
from mopro.cli.say import say
from mopro.errors import DataError

if TYPE_CHECKING:
    from mopro.controller import Station
    from mopro.link import Signals
    from mopro.machine import Machine
    from mopro.program import Program
    from mopro.recording import Run
    from mopro.recording.record import Columns
    from mopro.viewer.live import ControllerPanel, LiveRun
    from mopro.viewer.page_server import Page

# A run waits so long for its page to be looked at.
_LOOKED_AT_S = 10.0
# Samples that may wait for the page: ten seconds of them.
_MOST_WAITING = 200
_OF_THE_EXTRA = ("starlette", "uvicorn", "anyio", "h11")


class Live:
    """A live page: what it shows of the run, and the signals that its button is one of."""

    def __init__(self, run: LiveRun, signals: Signals) -> None:
        from mopro.link.writer import Writer

        self.signals = signals
        self._feed = run.feed
        self._drawing = DrawingSink(run)
        self._samples = Writer("the page", nullcontext(), _MOST_WAITING)

    def see(self, row: Mapping[str, float]) -> None:
        """Show one sample of a controller, in a thread.

        What the page does not take in time is left out, and what goes wrong costs the run nothing.
        """
        self._samples.offer(lambda _: self._see(row))

    def _see(self, row: Mapping[str, float]) -> None:
        import numpy as np

        columns = {name: np.array([value]) for name, value in row.items()}
        self._drawing.write(columns | {"line": columns["line"].astype(np.int32)})

    def write(self, columns: Columns) -> None:
        """Show a chunk of a recording."""
        self._drawing.write(columns)

    def end(self, run: Run) -> None:
        """Tell the page how the run ended."""
        from mopro.recording.run import outcome

        with suppress(DataError):
            self._samples.close()
        self._feed.end("\n".join(filter(None, (outcome(run), run.trouble))))


@contextmanager
def live_run(program: Program, machine: Machine, for_s: float | None) -> Iterator[Live]:
    """The live page of a run, open when the block begins, or after ten seconds at the latest.

    Its button ends a run that has entered `signals`, as a signal does. MotionError.
    """
    _need_the_extra()
    from mopro.link import Signals
    from mopro.viewer.live import LiveRun
    from mopro.viewer.page_server import Page
    from mopro.viewer.run import schedule_of

    run, signals = LiveRun(program, machine, schedule_of(machine, program, for_s)), Signals()
    stop = {"stop": lambda body: _ask(signals)}
    with _served(Page(run.title, run.feed, stop, {"stop": "Stop the motor"})):
        say("The run begins when the page is open.", err=True)
        run.feed.looked_at.wait(_LOOKED_AT_S)
        try:
            yield Live(run, signals)
        finally:
            if not run.feed.ended.is_set():
                run.feed.end("The run was ended before it was complete.")


def _ask(signals: Signals) -> None:
    signals.ask("stopped from the live page")


@contextmanager
def controller_panel(station: Station, machine: Machine) -> Iterator[ControllerPanel]:
    """The page of a virtual controller during the block."""
    _need_the_extra()
    from mopro.viewer.live import FAULTS, ControllerPanel
    from mopro.viewer.page_server import Page

    panel = ControllerPanel(station, machine)
    acts = {"stop": panel.stop, "fault": panel.fault}
    options = {"stop": "Stop the program", "faults": list(FAULTS)}
    with _served(Page(f"Virtual controller, {machine.name}", panel.feed, acts, options)):
        yield panel


@contextmanager
def _served(page: Page) -> Iterator[None]:
    """Serve `page`, tell its address, and open it where a person sits at a terminal."""
    from mopro.viewer.page_server import in_browser, serving

    with serving(page) as address:
        say(f"Page: {address}", err=True)
        with in_browser(address) if sys.stderr.isatty() else nullcontext():
            yield


def _need_the_extra() -> None:
    try:
        import mopro.viewer.page_server  # noqa: F401
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in _OF_THE_EXTRA:
            raise
        raise click.UsageError("this needs more: pip install 'mopro[web]'") from error
