"""A run as the host observes it: polls state and positions, and stops it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from mopro.errors import DataError, LinkError, MoproError
from mopro.link.course import UNDER_WAY, Contradiction, Course, Entry, Step
from mopro.link.flash import statements_of
from mopro.link.sampling import Sample, Samples
from mopro.link.session import Session
from mopro.program import AXES, Program

# The registers are told to within this time (s) of the moment that is taken for theirs.
_MOMENT_S = 0.1
_JUMPED = (
    "the controller's registers jumped by {} microsteps in {:.3f} s, faster than the program "
    "moves: is it another controller, or a virtual one of another --speed?"
)
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
    # What rests may be another controller than the one that ran.
    doubted: bool = False

    def report(self) -> str:
        """The controller's confirmation of the stop, for a person; empty if none was tried."""
        if self.precaution:
            answer = "acknowledged" if self.acknowledged else "not acknowledged"
            rest = "both axes rest" if self.rested else "standstill was not seen"
            return f"no run was started; a stop was sent to be sure: {answer}, {rest}"
        unsure = "NOT CONFIRMED: the machine may still be moving; use its own stop button"
        if not self.tried:
            return ""
        if self.rested and self.doubted:
            return f"stop: sent, and a controller rests, but it may be another one, {unsure}"
        if self.rested:
            return "stop: sent and acknowledged, and the controller reports that both axes rest"
        if self.acknowledged:
            return f"stop: sent and acknowledged, but standstill was not seen, {unsure}"
        if self.sent:
            return f"stop: sent, but not acknowledged, {unsure}"
        return f"stop: could not be sent, {unsure}"


class Watch:
    """One run, with its state as last polled; positions in microsteps from its start."""

    def __init__(
        self,
        session: Session,
        program: Program,
        samples: Samples,
        poll_hz: float,
        on_sample: Callable[[Sample], None] = lambda sample: None,
        hold: Callable[[], None] = lambda: None,
    ) -> None:
        self._hold = hold
        self._session = session
        self._program = program
        self._samples = samples
        self._on_sample = on_sample
        self._sensed = session.dialect.measures
        self._poll_s = 1 / poll_hz
        self._zero_u = dict.fromkeys(AXES, 0)
        self._seen_zero_u = dict.fromkeys(AXES, 0)
        self._started_s = self._first_sent_s = 0.0
        self._course: Course | None = None
        self._fastest_u_s = math.inf
        self._sampled_s = 0.0
        self.accounts = session.dialect.knows("moves")
        self.state = "idle"
        # As the controller last told them of this run, and when (s) it was last seen running.
        self.statement = self.completed = 0
        self.running_s = -math.inf
        # How many times faster than planned the controller does all.
        self.speed = 1.0
        self.position_u: dict[int, int] = dict.fromkeys(AXES, 0)
        self.moves: dict[int, dict[str, Any]] = {}
        # True once `moves` has all that the controller knows of, at rest.
        self.accounted = False
        self.elapsed_s = 0.0
        self.begun = False
        self._stop = Stop()

    # -- the run ---------------------------------------------------------------

    def mark_start(self) -> None:
        """Read the present positions as those of the start."""
        if self._session.dialect.knows("sample"):
            row = self._session.one("sample")
            self._zero_u = {axis: row[f"position_{axis}"] for axis in AXES}
            self._seen_zero_u = {axis: row[f"measured_{axis}"] for axis in AXES}
            return
        self._zero_u = self._positions("position")
        if self._sensed:
            self._seen_zero_u = self._positions("measured")

    def start(self, for_s: float | None) -> None:
        scratch = self._session.dialect.names.scratch
        self._started_s = self._first_sent_s = self._session.port.now_s()
        self.begun = True
        if for_s is None:
            self._session.ask("run", again=False, name=scratch)
        else:
            self._session.ask("run_for", again=False, name=scratch, milliseconds=for_s * 1000)
        self._started_s = self._session.moment_s
        self.state, self.running_s = "running", 0.0

    def follow(self, course: Course, fastest_u_s: float, settle_s: float = 0.0) -> Step:
        """Poll until the end that `course` awaits; Contradiction for every other one.

        No axis is faster than `fastest_u_s` (microsteps per s). After a program's end the positions
        are polled for `settle_s` more seconds. Gives STOP where the host has to cut the run.
        """
        self._course, self._fastest_u_s = course, fastest_u_s
        step = self._poll_in_turn()
        while step is Step.GO_ON:
            step = self._poll_in_turn()
        if step is Step.STOP:
            return step
        self._prove_rest()
        # At rest, and at its own end: what the line is too slow for is not known, and no trouble.
        with suppress(LinkError):
            self._account()
        if self.state == "done" and self._sensed:
            self._settle(settle_s)
        return step

    def _prove_rest(self) -> None:
        """LinkError if an axis moves at the end of a run."""
        moving = self._session.one("motion")
        if moving["moving_1"] or moving["moving_2"]:
            raise Contradiction(f"the controller says `{self.state}` while an axis moves")

    def _settle(self, settle_s: float) -> None:
        """Poll for `settle_s` seconds; a link that fails now takes nothing from the run."""
        until_s = self._session.port.now_s() + settle_s
        try:
            while self._session.port.now_s() < until_s:
                self._poll_in_turn()
        except Contradiction:
            raise
        except LinkError:
            return

    def _poll_in_turn(self) -> Step:
        """Poll, and wait until the next poll is due; Contradiction for an end not asked for."""
        next_s = self._session.port.now_s() + self._poll_s
        entry = self.poll()
        if not isinstance(entry, Step):
            raise Contradiction(entry)
        if entry is Step.GO_ON or self.state == "done":
            self._session.pause(next_s - self._session.port.now_s())
        return entry

    def poll(self) -> Entry:
        """Ask for state, positions and the account of finished moves; keep a sample.

        Gives what follows for the run's end.
        """
        status = self._status()
        self.state = status["state"]
        entry: Entry = Step.GO_ON
        if self._course is not None:
            entry = self._course.see(self.state, self._moment_s(), self._longest_s())
        self._note_place(status)
        sample = self._sampled()
        if self._jumped_to(sample):
            # A damaged digit, where no checksum tells, is not read twice.
            sample = self._sampled()
            if jump := self._jumped_to(sample):
                self._stop.doubted = True
                entry = jump if isinstance(entry, Step) else entry
                if self._course is not None:
                    return entry
        self.position_u, self._sampled_s = sample.command_u, sample.time_s
        self.elapsed_s = self._session.port.now_s() - self._started_s
        self._samples.add(sample)
        if self._course is not None:
            self._on_sample(sample)
        if self.accounts and self.state in UNDER_WAY and isinstance(entry, Step):
            self._ask_moves()
        return entry

    def _jumped_to(self, sample: Sample) -> str | None:
        """Why a sample cannot follow the one before it; None if it can."""
        elapsed_s = sample.time_s - self._sampled_s
        gone_u = max(abs(sample.command_u[axis] - self.position_u[axis]) for axis in AXES)
        if gone_u <= 1 + self._fastest_u_s * (elapsed_s + _MOMENT_S):
            return None
        return _JUMPED.format(gone_u, elapsed_s)

    @property
    def _place(self) -> int:
        """The statement under way, or the last one that was completed."""
        return self.statement or self.completed

    def _note_place(self, status: dict[str, Any]) -> None:
        """Keep how far the program got; a controller that was reset knows nothing of that."""
        if self.state == "idle":
            return
        self.statement = status.get("statement", 0)
        self.completed = status.get("completed", 0)
        if self.state == "running":
            self.running_s = self._moment_s()

    def _sampled(self) -> Sample:
        """Both positions, of one moment if the dialect has a statement for that."""
        if not self._session.dialect.knows("sample"):
            return self._sampled_in_parts()
        row = self._session.one("sample")
        statement = row.get("statement", 0) or self._place
        command_u = {n: row[f"position_{n}"] - self._zero_u[n] for n in AXES}
        seen_u = {n: row[f"measured_{n}"] - self._seen_zero_u[n] for n in AXES}
        return Sample(self._moment_s(), self.line(statement), command_u, seen_u, True)

    def _sampled_in_parts(self) -> Sample:
        """Both positions by one statement each, at the moment of the measured one if there is."""
        position = self._positions("position")
        command_u = {axis: position[axis] - self._zero_u[axis] for axis in AXES}
        seen_u: dict[int, int] = {}
        if self._sensed:
            measured = self._positions("measured")
            seen_u = {axis: measured[axis] - self._seen_zero_u[axis] for axis in AXES}
        at_rest = self.state not in UNDER_WAY
        line = self.line(self._place)
        return Sample(self._moment_s(), line, command_u, seen_u, at_rest or not self._sensed)

    def _longest_s(self) -> float:
        """How long the run may have lasted at that moment: it may have begun when first told to."""
        return self._session.moment_s - self._first_sent_s

    def _moment_s(self) -> float:
        """The time (s from the start of the run) at which the last statement was done."""
        return self._session.moment_s - self._started_s

    def _status(self) -> dict[str, Any]:
        """The status, its state translated; asked again while the word is in no [states]."""
        for _ in range(self._session.dialect.conversation.retries + 1):
            status = self._session.one("status")
            state = self._session.dialect.state_of(status["state"])
            if state is not None:
                return {**status, "state": state}
        raise LinkError(f"the status `{status['state']}` is in no [states]", "unknown-state")

    def _account(self) -> None:
        """Fetch the outcomes of all moves that are not known yet, at rest; none after a reset."""
        if self.accounts and self.state != "idle":
            while self._ask_moves():
                pass
            self.accounted = True

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
        course, self._course = self._course, None
        self._samples.hold()
        self._hold()
        self._session.give(within_s)
        until_s = self._session.port.now_s() + within_s
        self._stop.tried = True
        self._send_stop()
        tries = _MOST_TRIES_TO_STOP
        while tries and not self._stop.rested and self._session.port.now_s() < until_s:
            tries -= 1
            with suppress(*_TRY_AGAIN):
                self._confirm_stop()
        if course is not None and not course.may_rest_in(self.state, self._longest_s()):
            self._stop.doubted = True
        with suppress(*_TRY_AGAIN):
            if self._stop.rested and self.begun:
                self._account()
        return self._stop.rested and not self._stop.doubted

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
            rested = self.state not in UNDER_WAY and still and before_u == self.position_u
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
        if "completed" not in self._session.dialect.replies["status"].fields:
            return text
        if self.completed:
            return f"{text}\nlast completed: {self._named(self.completed)}"
        return f"{text}\nlast completed: nothing that takes time"

    def _named(self, statement: int) -> str:
        if not 1 <= statement <= len(self._program.ops):
            return f"statement {statement}"
        text = statements_of(self._program)[statement - 1]
        return f"line {self.line(statement)} `{text}`"

    def line(self, statement: int) -> int | None:
        """The source line of a statement of the program, which counts from 1; None for none."""
        if 1 <= statement <= len(self._program.ops):
            return self._program.ops[statement - 1].span.line
        return None
