"""The serial back end: the same programs, checks and recording, run by a controller."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from mopro.errors import LinkError
from mopro.link.flash import allowed_s, upload
from mopro.link.session import Session
from mopro.link.watch import Samples, Watch
from mopro.machine import DEFAULT_LOOP_S, Machine
from mopro.motion import Schedule, plan
from mopro.program import AXES, Program
from mopro.recording import Header, MoveOutcome, MoveReport, Run, Sink

POLL_HZ = 20.0
# A run may take this much longer than planned, by the host's clock, before it is stopped.
_SPARE_FACTOR = 1.1
_SPARE_S = 10.0
_STOP_S = 8.0

_ENDINGS = {
    "idle": "the controller knows of no run: it was reset",
    "stopped": "the controller was told to stop by someone else",
    "limit": "a limit switch opened",
    "overheated": "the motor is overheated",
}


@dataclass(frozen=True)
class SerialBackend:
    """A controller at the end of a line.

    `machine` gives the lengths of the axes; `deadline_s` is how long a run may take by
    the host's clock (as planned and some more, unless given).
    """

    session: Session
    machine: Machine
    poll_hz: float = POLL_HZ
    deadline_s: float | None = None

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

    def run(self, program: Program, sink: Sink, for_s: float | None = None) -> Run:
        """Load `program` into the scratch place, prove it, run it and watch it.

        Raises MotionError for what must be refused before anything is sent, and
        LinkError if it does not get as far as motion. After that every ending is a
        `Run`: what went wrong is its `trouble`, and the machine has been told to stop.
        """
        if for_s is None and program.loops_forever:
            for_s = DEFAULT_LOOP_S
        schedule = plan(program, for_s, self.machine.travel_u())
        self.session.give(allowed_s(self.session, program))
        upload(self.session, program, self.session.dialect.names.scratch, lambda done: None)
        samples = Samples(sink, schedule, self.machine.microstep_m)
        watch = Watch(self.session, program, samples, self.poll_hz)
        watch.mark_start()
        self.session.give(self.deadline_s or schedule.duration_s * _SPARE_FACTOR + _SPARE_S)
        trouble = self._watched(watch, schedule, for_s)
        samples.close()
        return self._report(schedule, watch, trouble)

    def _watched(self, watch: Watch, schedule: Schedule, for_s: float | None) -> str | None:
        """Start and watch until it ends; gives what went wrong, after a stop."""
        cut = None if schedule.complete else for_s
        timed = cut is not None and self.session.dialect.knows("run_for")
        try:
            watch.start(cut if timed else None)
            watch.follow(None if timed else cut)
            if watch.state == "running":
                return None if watch.stop(_STOP_S) else self._account("", watch)
            if watch.state in _ENDINGS:
                return self._account(_ENDINGS[watch.state], watch)
            return self._misplaced(watch, schedule)
        except (LinkError, KeyboardInterrupt) as error:
            reason = str(error) or "interrupted from the keyboard"
            watch.stop(_STOP_S)
            return self._account(reason, watch)

    def _account(self, reason: str, watch: Watch) -> str:
        """What a person must know after a run that did not end well."""
        return "\n".join(text for text in (reason, watch.stop_report(), watch.last_words()) if text)

    def _misplaced(self, watch: Watch, schedule: Schedule) -> str | None:
        """A finding if the controller's registers end elsewhere than the program's."""
        if watch.state != "done":
            return None
        wanted = {axis: schedule.final_u(axis) for axis in AXES}
        if watch.position_u == wanted:
            return None
        return f"the controller ended at {watch.position_u} microsteps, the program at {wanted}"

    def _report(self, schedule: Schedule, watch: Watch, trouble: str | None) -> Run:
        ended = watch.state == "done" and trouble is None
        cut = watch.state == "expired" and trouble is None
        return Run(
            program=schedule.program.name,
            machine=self.machine.name,
            duration_s=schedule.duration_s if ended or cut else watch.elapsed_s,
            loops_forever=schedule.program.loops_forever,
            complete=schedule.complete and ended,
            moves=tuple(self._moves(schedule, watch, whole=ended or cut)),
            trouble=trouble,
        )

    def _moves(self, schedule: Schedule, watch: Watch, whole: bool) -> list[MoveReport]:
        """A row for each move that began, with what the controller says of it."""
        rows = []
        for index, move in enumerate(schedule.moves, start=1):
            told = watch.moves.get(index)
            begun = whole or told or (not watch.accounts and move.start_s <= watch.elapsed_s)
            if begun:
                outcome = MoveOutcome(complete=move.end_s <= watch.elapsed_s)
                if told:
                    outcome = _told(told)
                elif whole:
                    outcome = MoveOutcome(complete=move.end_s <= schedule.duration_s)
                rows.append(MoveReport.of(move, outcome, self.machine.microstep_m))
        return rows


def _told(row: dict[str, Any]) -> MoveOutcome:
    return MoveOutcome(
        max_lag_m=row["lag"],
        stall_margin=row["margin"],
        lost_pitches=row["lost"],
        slipped=bool(row["slipped"]),
        complete=bool(row["complete"]),
    )
