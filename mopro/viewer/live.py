"""Live pages: the messages that feed them, a run sample by sample, the virtual controller."""

from __future__ import annotations

import json
import queue
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np

from mopro.controller import Station
from mopro.controller.faults import Fault, PlantFault
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.program import AXES, Program
from mopro.recording import Sink
from mopro.recording.envelope import Buckets, Envelope, Envelopes, Floats, channels_of
from mopro.recording.record import Columns
from mopro.viewer.run import (
    TRACK,
    phases_of,
    places_of,
    platen_json,
    platen_of,
    run_panels,
    run_track,
)
from mopro.viewer.view import Lines, Pack, View

# -- messages ---------------------------------------------------------------------------------
# Messages of a run to the pages that look at it; written in one thread, read in another.


# Messages that wait for a page; one that is further behind gets a snapshot instead.
_MOST_WAITING = 2000

Numbered = tuple[int, str, str]


class Feed:
    """Numbered messages (event and JSON); `snapshot` gives all that there is so far.

    What changes the state behind `snapshot` does so within `lock`.
    """

    def __init__(self, snapshot: Callable[[], dict[str, Any]]) -> None:
        self._snapshot = snapshot
        self._messages: deque[Numbered] = deque(maxlen=_MOST_WAITING)
        self._number = 0
        self.lock = threading.RLock()
        self.ended = threading.Event()
        self.looked_at = threading.Event()

    def tell(self, event: str, data: Any) -> None:
        """Add a message for all pages."""
        with self.lock:
            self._number += 1
            self._messages.append((self._number, event, _text(data)))

    def end(self, words: str) -> None:
        """Add the last message."""
        self.tell("end", words)
        self.ended.set()

    def begin(self) -> Numbered:
        """A snapshot as the first message of a page; those after its number follow it."""
        with self.lock:
            self.looked_at.set()
            return self._number, "snapshot", _text(self._snapshot())

    def after(self, number: int) -> list[Numbered]:
        """The messages after `number`, or a snapshot if some of them are gone."""
        with self.lock:
            if self._messages and self._messages[0][0] > number + 1:
                return [self.begin()]
            return [message for message in self._messages if message[0] > number]


def _text(data: Any) -> str:
    return json.dumps(data, allow_nan=False, separators=(",", ":"))


# -- a run ------------------------------------------------------------------------------------
# A run as a live page shows it, sample by sample.

# Buckets that a page gets when it opens, and at most in one message.
_MOST_BUCKETS = 8192
_MOST_TOLD = 8
_SLICE_S = 0.05


class LiveRun:
    """A sink that tells the samples of a run to the pages that look at it.

    `schedule` is the planned motion: what moves is shown.
    """

    def __init__(self, program: Program, machine: Machine, schedule: Schedule) -> None:
        self._program = program
        self._machine, self._schedule = machine, schedule
        self._moving = {str(axis) for move in schedule.moves for axis in move.axes} or {"1", "2"}
        self._name = f"{program.name} on {machine.name}"
        self._sink = Envelopes(_MOST_BUCKETS, 0)
        self._line: int | None = None
        self.feed = Feed(self.snapshot)

    @property
    def title(self) -> str:
        return self._name

    def write(self, columns: Columns) -> None:
        """Take a chunk of a recording."""
        if not len(columns["time_s"]):
            return
        with self.feed.lock:
            first = not self._sink.names
            self._sink.write(columns)
            if first:
                self.feed.tell("snapshot", self.snapshot())
            else:
                self.feed.tell("samples", self._samples(columns))
            self._line = int(columns["line"][-1])

    def snapshot(self) -> dict[str, Any]:
        """The view so far, with the block of its arrays; no view before the first sample."""
        if not self._sink.names:
            return {"views": [], "block": ""}
        shown = [name for name in self._sink.names if self._shows(name)]
        platen = platen_json(self._machine, self._schedule, places_of(shown))
        view = View(
            name=self._name, panels=run_panels(shown), tracks={TRACK: run_track(self._sink)},
            program=self._program.source.lines, lines=Lines(*self._sink.changes()), platen=platen,
            phases=phases_of(shown),
        )  # fmt: skip
        pack = Pack()
        return {"views": [view.as_json(pack)], "block": pack.text()}

    def _shows(self, name: str) -> bool:
        """True for what can be seen of an axis that moves, and what is of no axis."""
        still = {"1", "2"} - self._moving
        return name in self._sink and not any(f"_{n}_" in name for n in still)

    def _samples(self, columns: Columns) -> dict[str, Any]:
        time_s, line = columns["time_s"], columns["line"]
        before = line[0] - 1 if self._line is None else self._line
        at = np.flatnonzero(np.diff(line, prepend=before))
        return samples_json(time_s, channels_of(columns), TRACK) | {
            "lines": [[float(time_s[i]), int(line[i])] for i in at]
        }


class Paced:
    """A sink in real time: each slice of samples goes on when its time has come.

    `clock` and `sleep` are those of this computer unless given.
    """

    def __init__(
        self,
        sink: Sink,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._sink, self._clock, self._sleep = sink, clock, sleep
        self._begun_s: float | None = None

    def write(self, columns: Columns) -> None:
        time_s = columns["time_s"]
        edges = np.flatnonzero(np.diff(np.floor(time_s / _SLICE_S))) + 1
        bounds = [0, *edges.tolist(), len(time_s)]
        for begin, end in pairwise(bounds):
            if self._begun_s is None:
                self._begun_s = self._clock() - float(time_s[0])
            wait_s = self._begun_s + float(time_s[end - 1]) - self._clock()
            if wait_s > 0:
                self._sleep(wait_s)
            self._sink.write({name: values[begin:end] for name, values in columns.items()})


def samples_json(time_s: Floats, channels: Mapping[str, Floats], track: str) -> dict[str, Any]:
    """New samples of a track as a few buckets, as the page's scripts read them."""
    envelope = Envelope(_MOST_TOLD)
    envelope.add(time_s, np.vstack([v.astype(np.float32) for v in channels.values()]))
    found = envelope.buckets()
    return {
        "track": track,
        "start": found.start.tolist(),
        "end": found.end.tolist(),
        "channels": {name: _ends(found, row) for row, name in enumerate(channels)},
    }


def _ends(buckets: Buckets, row: int) -> list[list[float | None]]:
    """First and second extremes of a channel, None for what was not measured."""
    return [
        [value if isfinite(value) else None for value in ends[row].tolist()]
        for ends in (buckets.first, buckets.second)
    ]


# -- the virtual controller -------------------------------------------------------------------
# The virtual controller as a page: its platen, its program, and faults by click.

_TOLD_S = 0.05
_LASTING_S = 5.0

# What a button does: a fault of the machine now, or one of the wire or the controller.
_PLANT = {
    "axis 1 loses a pitch": PlantFault("lost_steps", 0.0, 1, 1),
    "axis 2 loses a pitch": PlantFault("lost_steps", 0.0, 2, 1),
    "limit switch opens": PlantFault("limit", 0.0),
    "motor overheats": PlantFault("overheated", 0.0),
}
_WIRE = {
    "power dip (reset)": Fault("reset", for_s=0.0),
    "plug pulled for 5 s": Fault("disconnect", for_s=_LASTING_S),
    "busy for 5 s": Fault("busy", for_s=_LASTING_S),
    "echo off for 5 s": Fault("echo_off", for_s=_LASTING_S),
    "next reply is lost": Fault("missing", rate=1.0, times=1),
    "next reply is garbled": Fault("garbled", rate=1.0, times=1),
    "a byte is lost": Fault("drop", rate=1.0, times=1),
}
FAULTS = (*_PLANT, *_WIRE)


class ControllerPanel:
    """A station seen by pages; `tick` is called by the one thread that serves the station."""

    def __init__(
        self, station: Station, machine: Machine, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._station = station
        self._machine = machine
        self._clock = clock
        self._asked: queue.SimpleQueue[Callable[[float], None]] = queue.SimpleQueue()
        self._sink = Envelopes(_MOST_BUCKETS, 0)
        self._due_s = -np.inf
        self._sent: tuple[Any, ...] = ()
        self._program: tuple[str, ...] = ()
        self._suffered: Counter[str] = Counter()
        self.feed = Feed(self.snapshot)

    # -- in the server's thread ------------------------------------------------

    def fault(self, body: str) -> None:
        """Have the fault named in `body` (JSON) happen; what is no fault is ignored."""
        try:
            name = str(json.loads(body))
        except (ValueError, RecursionError):
            return
        if name in _PLANT:
            self._asked.put(lambda now_s: self._suffer(name, now_s))
        elif name in _WIRE:
            self._asked.put(lambda now_s: self._station.suffer(_WIRE[name], now_s))

    def stop(self, body: str) -> None:
        """Stop the run, as somebody at the controller does."""
        self._asked.put(lambda now_s: _ignore(self._station.device.do("stop", {}, now_s)))

    # -- in the station's thread -----------------------------------------------

    def _suffer(self, name: str, now_s: float) -> None:
        self._suffered[name] += 1
        self._station.device.suffer(_PLANT[name], now_s)

    def tick(self, now_s: float) -> None:
        """Do what was asked for, and tell the pages of the state at `now_s`."""
        while not self._asked.empty():
            self._asked.get()(now_s)
        if self._clock() < self._due_s:
            return
        self._due_s = self._clock() + _TOLD_S
        self._station.device.move_on(now_s)
        with self.feed.lock:
            self._tell(now_s)

    def _tell(self, now_s: float) -> None:
        seen = self._station.device.seen()
        if seen.program != self._program or not self._sink.names:
            self._program = seen.program
            self._sink.write(self._columns(now_s))
            self.feed.tell("snapshot", self.snapshot())
        else:
            columns = self._columns(now_s)
            self._sink.write(columns)
            line = [[now_s, seen.line]] if self._sent[:1] != (seen.line,) else []
            samples = samples_json(columns["time_s"], channels_of(columns), TRACK)
            self.feed.tell("samples", samples | {"lines": line})
        happened = self._suffered + Counter(self._station.injector.happened)
        latest = (seen.line, seen.state, happened)
        if latest != self._sent:
            words = ", ".join(f"{kind} × {count}" for kind, count in happened.items())
            self.feed.tell("status", f"{seen.state}{f' · faults: {words}' if words else ''}")
        self._sent = latest

    def _columns(self, now_s: float) -> Columns:
        seen = self._station.device.seen()
        step_m = self._machine.microstep_m
        row = {"time_s": now_s}
        for axis in AXES:
            row[f"command_{axis}_m"] = seen.commanded_u[axis] * step_m
            row[f"position_{axis}_m"] = seen.actual_u[axis] * step_m
        row["temperature_C"] = seen.temperature_C
        columns: Columns = {name: np.array([value]) for name, value in row.items()}
        return columns | {"line": np.array([seen.line], dtype=np.int32)}

    def snapshot(self) -> dict[str, Any]:
        """The view so far, with the block of its arrays; no view before the first sample."""
        if not self._sink.names:
            return {"views": [], "block": ""}
        view = View(
            name=f"virtual controller, {self._machine.name}",
            panels=run_panels(self._sink.names), tracks={TRACK: run_track(self._sink)},
            program=self._program, lines=Lines(*self._sink.changes()),
            platen=platen_of(self._machine, self._machine.travel_u(), places_of(self._sink.names)),
        )  # fmt: skip
        pack = Pack()
        return {"views": [view.as_json(pack)], "block": pack.text()}


def _ignore(rows: object) -> None:
    """The reply to a statement that nobody waits for."""
