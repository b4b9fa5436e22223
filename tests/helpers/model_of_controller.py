"""A controller of a few lines, whose status words a test makes up, for `SerialBackend`.

It shares nothing with `mopro.controller`: one axis goes at constant speed from the start of a run
to its end. Every statement takes 10 ms of simulated time.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field

import mopro
from mopro.errors import LinkError
from mopro.link import SerialBackend
from mopro.link.dialect import STATES
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.recording import MemorySink

ANSWER_S = 0.01
BRAKING_S = 0.05
MACHINE = load_machine("chow1992")
# 0.2 in at constant acceleration: 0.3 s and a bit, which five polls outlast.
PROGRAM = mopro.compile("UU012500/1\nVEL1 1.0\nACC1 0.05\nMRI1 0.2\nWX1\n", "model.CMD")
LOOP = mopro.compile("UU012500/1\nVEL1 1.0\nACC1 0.05\n:A\nMRI1 0.2\nWX1\nMRI1 -0.2\nWX1\nJUMP A\n")
CUT_S = 0.3


class NoSignals:
    """Signals that do not come."""

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None

    def raised(self):
        return nullcontext()

    def deferred(self):
        return nullcontext()


@dataclass
class Controller:
    """The truth: what the motor does. `words` are what it says instead, as long as they last."""

    words: list[str]
    goes_for_s: float
    goes_u: int
    ends_as: str = "done"
    started_s: float | None = None
    stopped_s: float | None = None
    used: int = 0
    stored: list[str] = field(default_factory=list)

    def state(self, now_s):
        if self.started_s is None:
            return "idle"
        end_s = self.started_s + self.goes_for_s
        if self.stopped_s is not None and self.stopped_s < end_s:
            return "stopping" if now_s < self.stopped_s + BRAKING_S else "stopped"
        return "running" if now_s < end_s else self.ends_as

    def position_u(self, now_s):
        if self.started_s is None:
            return 0
        until_s = now_s if self.stopped_s is None else min(now_s, self.stopped_s)
        return round(self.goes_u * min(1.0, (until_s - self.started_s) / self.goes_for_s))

    def said_state(self, now_s):
        if self.started_s is not None and self.used < len(self.words):
            self.used += 1
            return self.words[self.used - 1]
        return self.state(now_s)

    @property
    def is_complete(self):
        """True if nothing stopped it before its end."""
        return self.started_s is not None and (
            self.stopped_s is None or self.stopped_s >= self.started_s + self.goes_for_s
        )


class Clock:
    """A port of which only the clock is used."""

    def __init__(self):
        self.time_s = 0.0

    def now_s(self):
        return self.time_s


class Talk:
    """The session with a Controller: statements without bytes."""

    def __init__(self, dialect, controller):
        self.dialect, self.controller = dialect, controller
        self.port = Clock()
        self.greeted = True
        self.retried = 0
        self.byte_s = 0.001
        self.moment_s = 0.0
        self.until_s = self.bound_s = 1e9

    def give(self, seconds):
        self.until_s = min(self.port.time_s + seconds, self.bound_s)

    def bound(self, until_s):
        self.bound_s = until_s
        self.until_s = min(self.until_s, until_s)

    def open(self):
        self.greeted = True

    def pause(self, seconds):
        self.port.time_s = max(
            self.port.time_s, min(self.port.time_s + max(seconds, 0.0), self.until_s)
        )

    def send_unanswered(self, statement):
        assert statement == "stop"
        self._stop()

    def stream(self, lines, done):
        self.controller.stored = list(lines)

    def one(self, statement, **fields):
        return self.ask(statement, **fields)[0]

    def ask(self, statement, again=True, **fields):
        if self.port.time_s >= self.until_s:
            raise LinkError("the time allowed is over", "deadline")
        self.port.time_s += ANSWER_S
        now_s = self.moment_s = self.port.time_s - ANSWER_S / 2
        return getattr(self, f"_{statement}")(now_s, **fields)

    def _begin(self, now_s, name):
        return []

    def _end(self, now_s):
        return []

    def _list(self, now_s, name):
        return [{"text": line} for line in self.controller.stored]

    def _speed(self, now_s):
        return [{"speed": 1.0}]

    def _heartbeat(self, now_s, milliseconds):
        return []

    def _run(self, now_s, name):
        self.controller.started_s = now_s
        return []

    def _run_for(self, now_s, name, milliseconds):
        return self._run(now_s, name)

    def _stop(self, now_s=None):
        if self.controller.stopped_s is None:
            self.controller.stopped_s = self.port.time_s if now_s is None else now_s
        return []

    def _status(self, now_s):
        word = self.controller.said_state(now_s)
        known = word in self.dialect.states
        return [{"state": self.dialect.states[word] if known else word, "statement": 4}]

    def _sample(self, now_s):
        u = self.controller.position_u(now_s)
        return [{"position_1": u, "position_2": 0, "measured_1": u, "measured_2": 0}]

    def _position(self, now_s):
        return self._sample(now_s)

    def _motion(self, now_s):
        moves = self.controller.state(now_s) in ("running", "stopping")
        return [{"moving_1": int(moves), "moving_2": 0}]

    def _moves(self, now_s, first):
        return []


@dataclass
class Ended:
    """What came of one run: what the host says, and the truth at that time."""

    trouble: str | None
    is_complete: bool
    still_moves: bool
    used: int


def told(words, dialect, looping=False):
    """The run of a controller that says `words` first, and the truth from then on."""
    program, for_s = (LOOP, CUT_S) if looping else (PROGRAM, None)
    schedule = plan(program, for_s, MACHINE.travel_u())
    # A dialect without `run_for` has the host cut a loop, which goes on without end.
    host_cuts = looping and not dialect.knows("run_for")
    goes_for_s = 100.0 if host_cuts else schedule.duration_s
    goes_u = round(goes_for_s * 2000) if looping else schedule.final_u(1)
    ends_as = "expired" if looping else "done"
    controller = Controller(list(words), goes_for_s, goes_u, ends_as)
    talk = Talk(dialect, controller)
    backend = SerialBackend(talk, MACHINE, signals=NoSignals())
    run = backend.run(program, MemorySink(), for_s)
    complete = controller.is_complete
    if host_cuts:
        complete = controller.stopped_s - controller.started_s >= CUT_S
    moves = controller.state(talk.port.time_s) in ("running", "stopping")
    return Ended(run.trouble, complete, moves, controller.used)


def sequences(most, dialect, looping, begin=()):
    """Each run that differs by the first `most` status words, with its words from `begin` on."""
    waiting = [begin]
    while waiting:
        said = waiting.pop()
        ended = told(said, dialect, looping)
        # What a run does not hear makes no other run of it.
        if ended.used == len(said) < most:
            waiting += [(*said, word) for word in STATES]
        yield said, ended
