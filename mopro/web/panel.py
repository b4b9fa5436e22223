"""The virtual controller as a page: its platen, its program, and faults by click."""

from __future__ import annotations

import json
import queue
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from mopro.controller import Station
from mopro.controller.faults import Fault, PlantFault
from mopro.machine import Machine
from mopro.program import AXES
from mopro.recording.envelope import Envelopes, channels_of
from mopro.recording.record import Columns
from mopro.viewer.model import Lines, View
from mopro.viewer.pack import Pack
from mopro.viewer.platen import platen_of
from mopro.viewer.run import TRACK, places_of, run_panels, run_track
from mopro.web.feed import Feed
from mopro.web.live import samples_json

_MOST_BUCKETS = 8192
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
        self._told: tuple[Any, ...] = ()
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
            line = [[now_s, seen.line]] if self._told[:1] != (seen.line,) else []
            told = samples_json(columns["time_s"], channels_of(columns), TRACK)
            self.feed.tell("samples", told | {"lines": line})
        happened = self._suffered + Counter(self._station.injector.happened)
        told_now = (seen.line, seen.state, happened)
        if told_now != self._told:
            words = ", ".join(f"{kind} × {count}" for kind, count in happened.items())
            self.feed.tell("status", f"{seen.state}{f' · faults: {words}' if words else ''}")
        self._told = told_now

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
        told = view.as_json(pack)
        return {"views": [told], "block": pack.text()}


def _ignore(rows: object) -> None:
    """The reply to a statement that nobody waits for."""
