"""The serial back end: the same programs, checks and recording, run by a controller."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from itertools import pairwise
from typing import Any

from mopro.errors import DataError, LinkError
from mopro.link.course import CAUSES, UNDER_WAY, Awaited, Contradiction, Course, Step
from mopro.link.flash import allowed_s, upload
from mopro.link.halt import Signals, StopOnError, TimeBudget
from mopro.link.sampling import Sample, Samples
from mopro.link.session import Refused, Session
from mopro.link.watch import Watch
from mopro.machine import DEFAULT_LOOP_S, Machine
from mopro.machine.backend import OnProgress, Progress, no_one
from mopro.motion import Schedule, plan
from mopro.program import AXES, Program
from mopro.recording import Header, MoveOutcome, MoveReport, Run, Sink, Stall


def reached_s(schedule: Schedule, watch: Watch) -> float:
    """The time (s) in `schedule` at which a run was left, for the moves that nobody tells of.

    Of the times at which the lines are under way and completed that the controller told last,
    that nearest to when it was last seen running.
    """
    if watch.state == "done":
        return schedule.duration_s
    near_s = watch.running_s * watch.speed
    reported = watch.line(watch.statement), watch.line(watch.completed)
    ends_s = (t for m in schedule.moves for t in (m.start_s, m.end_s))
    times_s = sorted({*ends_s, *(t for t, _ in schedule.activity)})
    fitting = (
        min(max(near_s, begin_s), math.nextafter(end_s, -math.inf))
        for begin_s, end_s in pairwise([*times_s, math.inf])
        if schedule.lines_at(begin_s) == reported
    )
    return min(fitting, key=lambda at_s: abs(at_s - near_s), default=near_s)


POLL_HZ = 20.0
OPENING_S = 15.0
# A run may take this much longer than planned, by the host's clock, before it is stopped.
_SPARE_FACTOR = 1.1
_SPARE_S = 10.0
_STOP_S = 8.0
# Bytes of both directions beside the time that a run, a stop and an outcome of a move take.
_RUN_BYTES, _STOP_BYTES, _MOVE_BYTES = 4000, 1000, 100
# The longest answer, several outcomes of moves, of which a silence is longer.
_LONGEST_ANSWER_BYTES = 800
# A controller that can brakes by itself after a silence of this, and of some lost lines.
_SILENCE_S = 3.0
_LINES_LOST = 3
_UNWATCHED = (
    "nothing stops the motor if this computer or the line fails in mid-run: "
    "keep a hand on the machine's own stop button"
)


@dataclass(frozen=True)
class SerialBackend:
    """Runs programs on a controller at the end of a line.

    `machine` gives the lengths of the axes; `deadline_s` is how long a run may take by
    the host's clock, from opening to standstill after a stop, counted from `begun_s` on
    the port's clock or else from the call of `run` (without it: each part as long as
    planned, and some more). `signals` is to be entered by who has something to say after
    the run that no signal may cut off. `warn` is told, before the start, what a person
    should know. `seen` is told each sample: its columns in a recording. `hold` keeps all
    streams of the run from being written from a stop on; none may hold up who writes to it
    (`Writer` is one such).
    """

    session: Session
    machine: Machine
    poll_hz: float = POLL_HZ
    deadline_s: float | None = None
    begun_s: float | None = None
    signals: Signals = field(default_factory=Signals)
    warn: Callable[[str], None] = lambda text: None
    seen: Callable[[Mapping[str, float]], None] = lambda row: None
    hold: Callable[[], None] = lambda: None

    def header(self, program: Program) -> Header:
        return Header(
            program=program.name,
            program_sha256=program.source.sha256,
            machine=self.machine.name,
            back_end=f"controller, dialect {self.session.dialect.name}",
            rate_hz=self.poll_hz,
            payload_kg=0.0,
            seed=0,
            versions={"python": platform.python_version(), "mopro": version("mopro")},
            clock="host",
        )

    def run(
        self,
        program: Program,
        sink: Sink,
        for_s: float | None = None,
        settle_s: float = 0.0,
        on_progress: OnProgress = no_one,
    ) -> Run:
        """Load `program` into the scratch place, prove it, run it and watch it.

        Where the controller measures positions, they are polled until `settle_s` seconds
        after the last move of a program that ends. `on_progress` hears of each poll.
        Raises MotionError for what must be refused before anything is sent. From then on
        whatever ends the run has been answered with a stop: LinkError or another error
        where no run was started, with the outcome of the stop as a note; after the start
        every ending is a `Run`, and what went wrong is its `trouble`.
        """
        if for_s is None and program.loops_forever:
            for_s = DEFAULT_LOOP_S
        schedule = plan(program, for_s, self.machine.travel_u())
        whole = self.signals.deferred
        sensed = self.session.dialect.measures
        samples = Samples(sink, schedule, self.machine.microstep_m, sensed, whole, self.seen)
        tell = self._teller(schedule, on_progress)
        watch = Watch(self.session, program, samples, self.poll_hz, tell, self.hold)
        stop_s = _STOP_S + _braking_s(schedule) + _STOP_BYTES * self.session.byte_s
        budget = TimeBudget(self.session, self.deadline_s, stop_s, self.begun_s)
        guard = StopOnError(watch, budget.for_stop)
        trouble = None
        with self.signals, closing(budget):
            with guard, self.signals.raised():
                self._load(program, watch)
                trouble = self._followed(watch, schedule, for_s, settle_s, budget)
            if guard.reason is not None:
                trouble = self._account(guard.reason, watch)
            trouble = _joined(trouble, _unwritten(samples))
        return replace(self._report(schedule, watch, trouble), rate_hz=samples.rate_hz)

    def _teller(self, schedule: Schedule, on_progress: OnProgress) -> Callable[[Sample], None]:
        """Tells `on_progress` of samples."""
        step_m, first = self.machine.microstep_m, schedule.program.ops[0].span.line

        def tell(sample: Sample) -> None:
            place_u = sample.seen_u or sample.command_u
            position_m = {axis: u * step_m for axis, u in place_u.items()}
            line = sample.line or first
            on_progress(Progress(sample.time_s, schedule.duration_s, line, position_m))

        return tell

    def _load(self, program: Program, watch: Watch) -> None:
        """Open the link, store the program, and read the positions at the start."""
        if not self.session.greeted:
            self.session.give(OPENING_S)
            self.session.open()
        self.session.give(allowed_s(self.session, program))
        upload(self.session, program, self.session.dialect.names.scratch, lambda done: None)
        watch.mark_start()

    def _ask_for_heartbeat(self, speed: float) -> None:
        """Make the controller brake the run by itself when the line falls silent."""
        dialect = self.session.dialect
        if not dialect.knows("heartbeat"):
            self.warn(f"the dialect {dialect.name} has no heartbeat: {_UNWATCHED}")
            return
        answer_s = _LONGEST_ANSWER_BYTES * self.session.byte_s
        wait_s = max(dialect.conversation.reply_timeout_s, 1 / self.poll_hz, answer_s)
        silence_s = max(_SILENCE_S, _LINES_LOST * wait_s)
        try:
            self.session.ask("heartbeat", milliseconds=silence_s * speed * 1000)
        except Refused as refused:
            self.warn(f"the controller refused a heartbeat ({refused.reason}): {_UNWATCHED}")

    def _followed(
        self,
        watch: Watch,
        schedule: Schedule,
        for_s: float | None,
        settle_s: float,
        budget: TimeBudget,
    ) -> str | None:
        """Start the run and watch it to its end; returns what went wrong after that, or None.

        Raises LinkError for every other end than the one asked for.
        """
        speed = watch.speed = self._speed()
        self._ask_for_heartbeat(speed)
        due_s = schedule.duration_s / speed
        awaited = self._awaited(schedule)
        moved_s = max((move.end_s for move in schedule.moves), default=-math.inf)
        rest_s = max(0.0, moved_s / speed + settle_s - due_s)
        on_the_line_s = (_RUN_BYTES + _MOVE_BYTES * len(schedule.moves)) * self.session.byte_s
        planned_s = due_s * _SPARE_FACTOR + _SPARE_S + rest_s + on_the_line_s
        self.session.give(planned_s if self.deadline_s is None else self.deadline_s)
        watch.start(for_s if awaited is Awaited.CUT else None)
        fastest_u_s = _fastest_u_s(schedule) * speed
        if watch.follow(Course(awaited, due_s), fastest_u_s, rest_s) is not Step.STOP:
            self._prove_end(watch, schedule)
            return None
        if watch.stop(budget.for_stop()) and watch.state == "stopped":
            return None
        unasked = watch.state not in ("stopped", *UNDER_WAY)
        return self._account(CAUSES.get(watch.state, "") if unasked else "", watch)

    def _awaited(self, schedule: Schedule) -> Awaited:
        """The end that the run of `schedule` is to have."""
        if schedule.complete:
            return Awaited.PROGRAM
        return Awaited.CUT if self.session.dialect.knows("run_for") else Awaited.HOST

    def _speed(self) -> float:
        """How many times faster than planned the controller does all: a virtual one may."""
        if not self.session.dialect.knows("speed"):
            return 1.0
        try:
            speed = float(self.session.one("speed")["speed"])
        except Refused:
            return 1.0
        if speed <= 0:
            raise LinkError(f"the controller says that it is {speed:g} times as fast", "no-speed")
        return speed

    def _account(self, reason: str, watch: Watch) -> str:
        """Report of a run that did not end well: reason, stop, last state, for a person."""
        return _joined(reason, watch.stop_report(), watch.last_report()) or ""

    def _prove_end(self, watch: Watch, schedule: Schedule) -> None:
        """Contradiction if the controller ends elsewhere than the program, or left out a move."""
        if watch.state != "done":
            return
        wanted = {axis: schedule.final_u(axis) for axis in AXES}
        if watch.position_u != wanted:
            raise Contradiction(
                f"the controller ended at {watch.position_u} microsteps, the program at {wanted}"
            )
        if unfinished := [n for n, row in watch.moves.items() if not row["complete"]]:
            raise Contradiction(f"the controller did not complete move {unfinished[0]}")

    def _report(self, schedule: Schedule, watch: Watch, trouble: str | None) -> Run:
        ended = watch.state == "done" and trouble is None
        cut = watch.state == "expired" and trouble is None
        moves = tuple(self._moves(schedule, watch, whole=ended or cut))
        return Run(
            program=schedule.program.name,
            machine=self.machine.name,
            duration_s=schedule.duration_s if ended or cut else watch.elapsed_s,
            loops_forever=schedule.program.loops_forever,
            complete=schedule.complete and ended,
            moves=moves,
            stalls=self._stalls(moves),
            trouble=trouble,
        )

    def _stalls(self, moves: Sequence[MoveReport]) -> tuple[Stall, ...]:
        """The stalls that the account tells of: it knows moves, and no times."""
        return tuple(
            Stall(None, m.line, m.axes[0] if len(m.axes) == 1 else None, m.lost_pitches)
            for m in moves
            if m.slipped
        )

    def _moves(self, schedule: Schedule, watch: Watch, whole: bool) -> list[MoveReport]:
        """A row for each move that began, with what the controller says of it."""
        rows = []
        until_s = schedule.duration_s if whole else reached_s(schedule, watch)
        for index, move in enumerate(schedule.moves, start=1):
            account = watch.moves.get(index)
            begun = whole or account or (not watch.accounted and move.start_s <= until_s)
            if begun:
                outcome = MoveOutcome(complete=move.end_s <= until_s)
                if account:
                    outcome = _outcome_of(account)
                rows.append(MoveReport.of(move, outcome, self.machine.microstep_m))
        return rows


def _braking_s(schedule: Schedule) -> float:
    """The longest that an axis can take to brake, in seconds."""
    profiles = [move.profile for move in schedule.moves]
    return max((p.peak_velocity / p.acceleration for p in profiles), default=0.0)


def _fastest_u_s(schedule: Schedule) -> float:
    """The largest speed of an axis, in microsteps per s."""
    return max((move.profile.peak_velocity for move in schedule.moves), default=0.0)


def _unwritten(samples: Samples) -> str | None:
    """Write the last samples; returns what went wrong, or None."""
    try:
        samples.close()
    except DataError as error:
        return f"the run has ended; {error}"
    return None


def _joined(*texts: str | None) -> str | None:
    return "\n".join(text for text in texts if text) or None


def _outcome_of(row: dict[str, Any]) -> MoveOutcome:
    return MoveOutcome(
        max_lag_m=row["lag"],
        stall_margin=row["margin"],
        lost_pitches=row["lost"],
        slipped=bool(row["slipped"]),
        complete=bool(row["complete"]),
    )
