"""A run as a live page shows it, sample by sample."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np

from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.program import Program
from mopro.recording import Sink
from mopro.recording.envelope import Buckets, Envelope, Envelopes, Floats, channels_of
from mopro.recording.record import Columns
from mopro.viewer.model import Lines, View
from mopro.viewer.pack import Pack
from mopro.viewer.platen import platen_json
from mopro.viewer.run import TRACK, phases_of, places_of, run_panels, run_track
from mopro.web.feed import Feed

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
        told = view.as_json(pack)
        return {"views": [told], "block": pack.text()}

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
