"""The controller without its wire: stored programs, position registers, state of the run.

Statements come by their names in the dialect file, each with the time in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mopro.controller.faults import PlantFault
from mopro.controller.running import Motion
from mopro.controller.store import MOST_PROGRAMS, Store, is_name
from mopro.emulator import Emulator
from mopro.errors import DataError, LocatedError
from mopro.language import parse
from mopro.program import AXES, Program, lower
from mopro.source import Source

MOST_STATEMENTS = 10_000
_MOST_MOVES_TOLD = 8
_LONGEST_REASON = 48

Row = dict[str, Any]


@dataclass(frozen=True)
class Seen:
    """The controller as somebody beside it sees it; positions in microsteps from the middle.

    `program` are the lines of the present or last run, `line` the one under way (0: none).
    """

    state: str
    line: int
    program: tuple[str, ...]
    commanded_u: dict[int, int]
    actual_u: dict[int, float]
    temperature_C: float


class Refusal(Exception):
    """A statement that the controller refuses: `code` is its error number, `reason` its text."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason[:_LONGEST_REASON].encode("ascii", "replace").decode()


class Device:
    """One controller with its motor.

    `plant_faults` occur in every run, at their times (s) from its start. `grammar` is the
    language of the programs that it takes.
    """

    def __init__(
        self,
        emulator: Emulator,
        store: Store,
        plant_faults: Sequence[PlantFault] = (),
        grammar: str = "attested",
    ) -> None:
        self._emulator = emulator
        self._store = store
        self._faults = plant_faults
        self._grammar = grammar
        self._download: tuple[str, list[str]] | None = None
        self._motion: Motion | None = None
        self._started_s = 0.0
        self._pending: list[PlantFault] = []
        self._ending = ""
        # Silence of the host (s) after which the present run brakes, and the next one.
        self._silence_s = self._next_silence_s = math.inf
        self._heard_s = 0.0
        # How many times faster than real time the clock of this controller goes.
        self.speed = 1.0
        # Who says what comes next, and who has started the present run.
        self.speaker: object = None
        self._starter: object = None
        self.state = "idle"
        # Commanded and actual position at the last start, in microsteps from the middle of
        # the platen, and the origin of the position registers.
        self._commanded_u = dict.fromkeys(AXES, 0)
        self._actual_u = dict.fromkeys(AXES, 0.0)
        self._origin_u = dict.fromkeys(AXES, 0)
        self._statements: dict[str, Callable[..., list[Row]]] = {
            "identify": lambda: [{"text": "MOPRO VIRTUAL CONTROLLER"}],
            "begin": self._begin,
            "end": self._end_download,
            "list": self._list,
            "commit": self._commit,
            "run": self._run,
            "run_for": lambda name, milliseconds: self._run(name, milliseconds / 1000),
            "stop": self._stop,
            "status": self._status,
            "motion": self._moving,
            "position": self._position,
            "measured": self._measured,
            "sample": self._sample,
            "moves": self._moves,
            "heartbeat": self._heartbeat,
            "speed": lambda: [{"speed": self.speed}],
        }
        self._now_s = 0.0

    # -- from outside ----------------------------------------------------------

    @property
    def downloading(self) -> bool:
        return self._download is not None

    def do(self, statement: str, fields: Row, now_s: float) -> list[Row]:
        """Execute one statement at `now_s`; returns the fields of each reply line.

        Raises Refusal.
        """
        self.hear(now_s)
        return self._statements[statement](**fields)

    def hear(self, now_s: float) -> None:
        """Note that the `speaker` sent something at `now_s`.

        It restarts the heartbeat of the run that this speaker has started.
        """
        self.move_on(now_s)
        if self.speaker == self._starter:
            self._heard_s = now_s

    def take(self, line: str) -> None:
        """Add a line to the download under way; Refusal if it is no statement."""
        assert self._download is not None, "the protocol asks first"
        if len(self._download[1]) >= MOST_STATEMENTS:
            raise Refusal(7, f"more than {MOST_STATEMENTS} statements")
        try:
            parse(Source("line", line), self._grammar)
        except LocatedError as error:
            raise Refusal(5, error.diagnostics[0].message) from error
        self._download[1].append(line)

    def abandon_download(self) -> None:
        self._download = None

    def reset(self, now_s: float) -> None:
        """Restart at `now_s`, as after a power dip: runs are dropped, stored programs stay."""
        self.move_on(now_s)
        self._download = None
        self._next_silence_s = math.inf
        if self._motion is not None:
            if self.state in ("running", "stopping"):
                at_s = self._motion.tick_after(now_s - self._started_s)
                self._motion.stop(at_s, abruptly=True)
                self._come_to_rest("idle")
            self._motion = None
        self.state = "idle"
        self._origin_u = dict(self._commanded_u)

    def move_on(self, now_s: float) -> None:
        """Advance the run to `now_s`: faults, limit switches, braking, its end."""
        self._now_s = now_s
        motion = self._motion
        if motion is None or self.state not in ("running", "stopping"):
            return
        at_s = now_s - self._started_s
        if self.state == "running":
            motion.look_ahead(at_s)
            self._apply_events(motion, at_s)
        if self.state == "running" and at_s >= motion.end_s:
            if motion.schedule.complete:
                self._come_to_rest("done")
                return
            motion.expire()
            self.state, self._ending = "stopping", "expired"
        motion.advance(at_s)
        if self.state == "stopping" and at_s >= motion.end_s and motion.calm():
            self._come_to_rest(self._ending)

    # -- beside it -------------------------------------------------------------

    def suffer(self, fault: PlantFault, now_s: float) -> None:
        """Have a fault of the machine happen at `now_s`, if a program runs."""
        self.move_on(now_s)
        if self.state == "running":
            self._pending.append(replace(fault, run_s=now_s - self._started_s))

    def seen(self) -> Seen:
        """The state at the time of the last statement or `move_on`."""
        motion, at = self._motion, {axis: self._at(axis) for axis in AXES}
        heat = self._emulator.machine.heat
        return Seen(
            state=self.state,
            line=self._status()[0]["statement"] if self._is_under_way() else 0,
            program=() if motion is None else motion.program.source.lines,
            commanded_u={axis: commanded for axis, (commanded, _) in at.items()},
            actual_u={axis: actual for axis, (_, actual) in at.items()},
            temperature_C=heat.ambient_C if motion is None else motion.temperature_C,
        )

    def _is_under_way(self) -> bool:
        return self._motion is not None and self.state in ("running", "stopping")

    # -- motion ----------------------------------------------------------------

    def _apply_events(self, motion: Motion, at_s: float) -> None:
        """Apply faults, limit switches and heartbeat up to `at_s` of the run, in order of time."""
        events = [(f.run_s, f.kind, f.axis, f.pitches) for f in self._pending]
        events.append((motion.limit_s, "limit", 0, 0))
        events.append((self._heard_s + self._silence_s - self._started_s, "silent", 0, 0))
        for time_s, kind, axis, pitches in sorted(events):
            if time_s > min(at_s, motion.end_s):
                return
            if kind == "lost_steps":
                motion.slip_at(time_s, axis, pitches)
                self._pending = [f for f in self._pending if f.run_s > time_s]
            else:
                self._brake(kind, time_s)
                return
        motion.advance(at_s)
        if motion.temperature_C > self._emulator.machine.heat.rated_C:
            self._brake("overheated", at_s)

    def _brake(self, ending: str, at_s: float) -> None:
        """Brake all axes from `at_s` on; the state becomes `ending` at standstill."""
        assert self._motion is not None, "only a running program is stopped"
        self._motion.stop(self._motion.tick_after(at_s))
        self.state, self._ending = "stopping", ending

    def _come_to_rest(self, ending: str) -> None:
        motion = self._motion
        assert motion is not None, "only a run comes to rest"
        motion.finish()
        for axis in AXES:
            self._commanded_u[axis] += motion.command_u(axis, motion.end_s)
            self._actual_u[axis] += motion.seen_u[axis]
        self.state = ending

    def _at(self, axis: int) -> tuple[int, float]:
        """Commanded and actual position of `axis` in microsteps from the middle of the platen."""
        commanded, actual = self._commanded_u[axis], self._actual_u[axis]
        if self._motion is not None and self.state in ("running", "stopping"):
            commanded += self._motion.command_u(axis, self._now_s - self._started_s)
            actual += self._motion.seen_u[axis]
        return commanded, actual

    def in_motion(self, axis: int) -> bool:
        if self._motion is None or self.state not in ("running", "stopping"):
            return False
        at_s = self._now_s - self._started_s
        return self.state == "stopping" or self._motion.commanded_to_move(axis, at_s)

    # -- statements ------------------------------------------------------------

    def _at_rest(self) -> None:
        if self.state in ("running", "stopping"):
            raise Refusal(4, "a program is running")

    def _named(self, name: str) -> str:
        if not is_name(name.upper()):
            raise Refusal(2, "a name is a letter and up to 15 letters or digits")
        return name.upper()

    def _stored(self, name: str) -> list[str]:
        lines = self._store.read(self._named(name))
        if lines is None:
            raise Refusal(3, "nothing is stored under this name")
        return lines

    def _begin(self, name: str) -> list[Row]:
        self._at_rest()
        name = self._named(name)
        names = self._store.names()
        if name not in names and len(names) >= MOST_PROGRAMS:
            raise Refusal(8, "no room for another program")
        self._download = (name, [])
        return []

    def _end_download(self) -> list[Row]:
        if self._download is None:
            raise Refusal(6, "no download is under way")
        name, lines = self._download
        self._download = None
        self._compiled(lines)
        self._keep(name, lines)
        return []

    def _compiled(self, lines: list[str]) -> Program:
        source = Source("program", "".join(f"{line}\n" for line in lines))
        try:
            return lower(parse(source, self._grammar))
        except LocatedError as error:
            raise _refusal_of(error) from error

    def _list(self, name: str) -> list[Row]:
        lines = self._store.read(self._named(name)) or []
        return [{"index": i, "text": line} for i, line in enumerate(lines, start=1)]

    def _commit(self, scratch: str, name: str) -> list[Row]:
        self._at_rest()
        lines, name = self._stored(scratch), self._named(name)
        names = self._store.names()
        if name not in names and len(names) >= MOST_PROGRAMS:
            raise Refusal(8, "no room for another program")
        self._keep(name, lines)
        return []

    def _keep(self, name: str, lines: list[str]) -> None:
        """Store a program durably; Refusal if the store cannot."""
        try:
            self._store.write(name, lines)
        except DataError as error:
            raise Refusal(8, "the program cannot be kept") from error

    def _run(self, name: str, for_s: float | None = None) -> list[Row]:
        self._at_rest()
        if for_s is not None and for_s <= 0:
            raise Refusal(2, "a time must be greater than 0")
        program = self._compiled(self._stored(name))
        travel_u = {
            axis: (low - self._commanded_u[axis], high - self._commanded_u[axis])
            for axis, (low, high) in self._emulator.machine.travel_u().items()
        }
        try:
            self._motion = Motion(self._emulator, program, travel_u, for_s)
        except LocatedError as error:
            raise _refusal_of(error) from error
        self._started_s = self._heard_s = self._now_s
        self._starter = self.speaker
        self._silence_s, self._next_silence_s = self._next_silence_s, math.inf
        self._pending = sorted(self._faults, key=lambda fault: fault.run_s)
        self.state = "running"
        return []

    def _heartbeat(self, milliseconds: float) -> list[Row]:
        if milliseconds <= 0:
            raise Refusal(2, "a time must be greater than 0")
        self._next_silence_s = milliseconds / 1000
        return []

    def _stop(self) -> list[Row]:
        if self.state == "running":
            self._brake("stopped", self._now_s - self._started_s)
        return []

    def _status(self) -> list[Row]:
        statement = completed = 0
        if self._motion is not None:
            at_s = self._now_s - self._started_s
            statement, completed = self._motion.statements(at_s)
        return [{"state": self.state, "statement": statement, "completed": completed}]

    def _moving(self) -> list[Row]:
        return [{f"moving_{axis}": int(self.in_motion(axis)) for axis in AXES}]

    def _position(self) -> list[Row]:
        return [{f"position_{n}": self._at(n)[0] - self._origin_u[n] for n in AXES}]

    def _measured(self) -> list[Row]:
        return [self._measured_as("position")]

    def _measured_as(self, name: str) -> Row:
        return {f"{name}_{n}": round(self._at(n)[1]) - self._origin_u[n] for n in AXES}

    def _sample(self) -> list[Row]:
        """Commanded and actual positions at one moment: that of the last sample of the motion."""
        row = self._status()[0] | self._measured_as("measured")
        for axis in AXES:
            row[f"position_{axis}"] = self._sampled_command_u(axis) - self._origin_u[axis]
        return [row]

    def _sampled_command_u(self, axis: int) -> int:
        if self._motion is None or self.state not in ("running", "stopping"):
            return self._commanded_u[axis]
        return self._commanded_u[axis] + self._motion.command_u(axis, self._motion.sampled_s)

    def _moves(self, first: int) -> list[Row]:
        if self._motion is None:
            return []
        return [
            {
                "index": number,
                "complete": int(outcome.complete),
                "lag": outcome.max_lag_m,
                "margin": outcome.stall_margin,
                "lost": outcome.lost_pitches,
                "slipped": int(outcome.slipped),
            }
            for number, outcome in self._motion.account(max(1, first), _MOST_MOVES_TOLD)
        ]


def _refusal_of(error: LocatedError) -> Refusal:
    first = min(error.diagnostics, key=lambda finding: finding.span)
    return Refusal(6, f"statement {first.span.line}: {first.message}")
