"""A run as the host observes it: polls state and positions, and stops it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from mopro.errors import DataError, LinkError, MoproError
from mopro.link.flash import statements_of
from mopro.link.session import Session
from mopro.motion import Schedule
from mopro.program import AXES, Program
from mopro.recording import Sink, column_names
from mopro.recording.record import Columns

_UNDER_WAY = ("running", "stopping")
_HELD_ROWS = 256
_MOST_TRIES_TO_STOP = 10
_PRECAUTION_S = 2.0
# Exceptions during an attempt to stop, after which the next attempt follows.
_TRY_AGAIN = (MoproError, OSError, ValueError, ArithmeticError, KeyboardInterrupt)


@dataclass
class Stop:
    """Progress of a stop; `precaution` if no run had been started."""

    tried: bool = False
    sent: bool = False
    acknowledged: bool = False
    rested: bool = False
    precaution: bool = False

    def report(self) -> str:
        """The controller's confirmation of the stop, for a person; empty if none was tried."""
        if self.precaution:
            told = "acknowledged" if self.acknowledged else "not acknowledged"
            rest = "both axes rest" if self.rested else "standstill was not seen"
            return f"no run was started; a stop was sent to be sure: {told}, {rest}"
        unsure = "NOT CONFIRMED: the machine may still be moving; use its own stop button"
        if not self.tried:
            return ""
        if self.rested:
            return "stop: sent and acknowledged, and the controller reports that both axes rest"
        if self.acknowledged:
            return f"stop: sent and acknowledged, but standstill was not seen, {unsure}"
        if self.sent:
            return f"stop: sent, but not acknowledged, {unsure}"
        return f"stop: could not be sent, {unsure}"


class Samples:
    """Writes polled samples to a sink, with NaN in the columns that are not measured.

    `whole` is the context of each write, so that no signal interrupts one. A sink that has
    failed gets no more. `seen` is told each row at once.
    """

    def __init__(
        self,
        sink: Sink,
        schedule: Schedule,
        microstep_m: float,
        whole: Callable[[], AbstractContextManager[None]] = nullcontext,
        seen: Callable[[Mapping[str, float]], None] = lambda row: None,
    ) -> None:
        self._seen = seen
        self._sink: Sink | None = sink
        self._whole = whole
        self._holding = False
        self._microstep_m = microstep_m
        self._rows: list[dict[str, float]] = []
        self._line = schedule.program.ops[0].span.line

    def add(
        self, time_s: float, line: int | None, command_u: dict[int, int], seen_u: dict[int, int]
    ) -> None:
        self._line = line or self._line
        row = {"time_s": time_s, "line": float(self._line)}
        for axis in AXES:
            row[f"command_{axis}_m"] = command_u[axis] * self._microstep_m
            row[f"position_{axis}_m"] = seen_u.get(axis, command_u[axis]) * self._microstep_m
        self._rows.append(row)
        self._seen(row)
        if len(self._rows) >= _HELD_ROWS and not self._holding:
            self.close()

    def hold(self) -> None:
        """Buffer samples until `close`, so that a slow or failing sink cannot delay a stop."""
        self._holding = True

    def close(self) -> None:
        """Write the buffered samples; DataError if the sink cannot."""
        if not self._rows or self._sink is None:
            return
        names = column_names(AXES)
        columns = {n: np.array([row.get(n, np.nan) for row in self._rows]) for n in names}
        columns["line"] = columns["line"].astype(np.int32)
        self._rows.clear()
        with self._whole():
            self._hand_on(self._sink, columns)

    def _hand_on(self, sink: Sink, columns: Columns) -> None:
        self._sink = None
        try:
            sink.write(columns)
        except OSError as error:
            message = f"the recording cannot be written: {error.strerror or error}"
            raise DataError(message, "unwritable-output") from error
        self._sink = sink


class Watch:
    """One run, with its state as last polled; positions in microsteps from its start."""

    def __init__(
        self, session: Session, program: Program, samples: Samples, poll_hz: float
    ) -> None:
        self._session = session
        self._program = program
        self._samples = samples
        self._poll_s = 1 / poll_hz
        self._zero_u = dict.fromkeys(AXES, 0)
        self._seen_zero_u = dict.fromkeys(AXES, 0)
        self._started_s = 0.0
        self.accounts = session.dialect.knows("moves")
        self.state = "idle"
        self.statement = self.completed = 0
        self.position_u: dict[int, int] = dict.fromkeys(AXES, 0)
        self.moves: dict[int, dict[str, Any]] = {}
        self.elapsed_s = 0.0
        self.begun = False
        self._stop = Stop()

    # -- the run ---------------------------------------------------------------

    def mark_start(self) -> None:
        """Read the present positions as those of the start."""
        self._zero_u = self._positions("position")
        if self._session.dialect.knows("measured"):
            self._seen_zero_u = self._positions("measured")

    def start(self, for_s: float | None) -> None:
        scratch = self._session.dialect.names.scratch
        self._started_s = self._session.port.now_s()
        self.begun = True
        if for_s is None:
            self._session.ask("run", again=False, name=scratch)
        else:
            self._session.ask("run_for", again=False, name=scratch, milliseconds=for_s * 1000)
        self.state = "running"

    def follow(self, for_s: float | None) -> None:
        """Poll until the run has ended, or `for_s` seconds of the host's clock are over."""
        while self.state in _UNDER_WAY:
            if for_s is not None and self.elapsed_s >= for_s:
                return
            next_s = self._session.port.now_s() + self._poll_s
            self.poll()
            if self.state in _UNDER_WAY:
                self._session.pause(next_s - self._session.port.now_s())
        self.poll()
        if self.accounts and self.state != "idle":
            while self._ask_moves():
                pass

    def poll(self) -> None:
        """Ask for state, positions and the account of finished moves; keep a sample."""
        status = self._status()
        self.state = status["state"]
        if self.state not in ("idle", "done"):
            self.statement = status.get("statement", 0)
        self.completed = status.get("completed", 0)
        position = self._positions("position")
        self.position_u = {axis: position[axis] - self._zero_u[axis] for axis in AXES}
        self.elapsed_s = self._session.port.now_s() - self._started_s
        seen: dict[int, int] = {}
        if self._session.dialect.knows("measured"):
            measured = self._positions("measured")
            seen = {axis: measured[axis] - self._seen_zero_u[axis] for axis in AXES}
        self._samples.add(self.elapsed_s, self._line(self.statement), self.position_u, seen)
        if self.accounts and self.state in _UNDER_WAY:
            self._ask_moves()

    def _status(self) -> dict[str, Any]:
        """The status, its state translated; asked again while the word is in no [states]."""
        for _ in range(self._session.dialect.conversation.retries + 1):
            status = self._session.one("status")
            state = self._session.dialect.state_of(status["state"])
            if state is not None:
                return {**status, "state": state}
        raise LinkError(f"the status `{status['state']}` is in no [states]", "unknown-state")

    def _ask_moves(self) -> bool:
        """Fetch outcomes of moves that are not known yet; True if any came."""
        before = len(self.moves)
        rows = self._session.ask("moves", first=before + 1)
        self.moves.update((row["index"], row) for row in rows if row["index"] > before)
        return len(self.moves) > before

    def _positions(self, statement: str) -> dict[int, int]:
        row = self._session.one(statement)
        return {axis: row[f"position_{axis}"] for axis in AXES}

    # -- stopping --------------------------------------------------------------

    def stop(self, within_s: float) -> bool:
        """Tell the machine to stop and see that it does; False if that is not certain.

        The stop goes out before anything else is said or awaited. Nothing but the end of
        `within_s` ends the tries to have it acknowledged and to see both axes at rest.
        Where no run was started it is a precaution, and a controller that was never there
        is not waited for.
        """
        if not self.begun:
            self._stop.precaution = True
            within_s = min(within_s, _PRECAUTION_S) if self._session.greeted else 0.0
        self._samples.hold()
        self._session.give(within_s)
        until_s = self._session.port.now_s() + within_s
        self._stop.tried = True
        self._send_stop()
        tries = _MOST_TRIES_TO_STOP
        while tries and not self._stop.rested and self._session.port.now_s() < until_s:
            tries -= 1
            with suppress(*_TRY_AGAIN):
                self._confirm_stop()
        with suppress(*_TRY_AGAIN):
            while self._stop.rested and self.begun and self.accounts and self._ask_moves():
                pass
        return self._stop.rested

    def _send_stop(self) -> None:
        """Send the stop without awaiting an answer; a failing trace cannot prevent it."""
        with suppress(LinkError, OSError):
            with suppress(DataError):
                self._session.send_unanswered("stop")
            self._stop.sent = True

    def _confirm_stop(self) -> None:
        self._session.open()
        self._session.ask("stop")
        self._stop.sent = self._stop.acknowledged = True
        rests = 0
        while rests < 2:
            before_u = dict(self.position_u)
            self.poll()
            moving = self._session.one("motion")
            still = not (moving["moving_1"] or moving["moving_2"])
            rested = self.state not in _UNDER_WAY and still and before_u == self.position_u
            rests = rests + 1 if rested else 0
        self._stop.rested = True

    def stop_report(self) -> str:
        """The outcome of the stop, for a person; empty if there was none."""
        return self._stop.report()

    # -- words -----------------------------------------------------------------

    def last_report(self) -> str:
        """The last polled state and the last completed statement, for a person."""
        place = ", ".join(f"axis {axis} at {u:+d}" for axis, u in self.position_u.items())
        text = f"last reported after {self.elapsed_s:.3f} s: {self.state}, {place} microsteps"
        if self.statement:
            text += f"; under way: {self._named(self.statement)}"
        if self.completed:
            return f"{text}\nlast completed: {self._named(self.completed)}"
        return f"{text}\nlast completed: nothing that takes time"

    def _named(self, statement: int) -> str:
        if not 1 <= statement <= len(self._program.ops):
            return f"statement {statement}"
        text = statements_of(self._program)[statement - 1]
        return f"line {self._line(statement)} `{text}`"

    def _line(self, statement: int) -> int | None:
        if 1 <= statement <= len(self._program.ops):
            return self._program.ops[statement - 1].span.line
        return None
