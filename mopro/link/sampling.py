"""Samples of a run as the host polls them, on their way to a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np

from mopro.errors import DataError
from mopro.motion import Schedule
from mopro.program import AXES
from mopro.recording import Sink
from mopro.recording.record import Columns

_HELD_ROWS = 256


@dataclass(frozen=True)
class Sample:
    """Positions of the axes, in microsteps from the start, `time_s` after the start.

    `seen_u` is empty where nothing measures positions. `one_moment` is false if the command
    was asked for at another moment than the measured positions, while it may have changed.
    """

    time_s: float
    line: int | None
    command_u: dict[int, int]
    seen_u: dict[int, int]
    one_moment: bool


class Samples:
    """Writes polled samples to a sink: time, line, and the positions that can be known.

    Each row is of one moment, that of the measured positions where there are any. A command
    of another moment is recorded if it was the same, in the same line, at the poll after it;
    else it is NaN. `whole` is the context of each write, so that no signal interrupts one. A
    sink that has failed gets no more. `seen` is told each row at once.
    """

    def __init__(
        self,
        sink: Sink,
        schedule: Schedule,
        microstep_m: float,
        sensed: bool,
        whole: Callable[[], AbstractContextManager[None]] = nullcontext,
        seen: Callable[[Mapping[str, float]], None] = lambda row: None,
    ) -> None:
        self._seen = seen
        kinds = ("command", "position") if sensed else ("command",)
        self._names = ["time_s", *(f"{kind}_{axis}_m" for axis in AXES for kind in kinds), "line"]
        self._unsure: Sample | None = None
        self._count = 0
        self._first_s = self._last_s = 0.0
        self._sink: Sink | None = sink
        self._whole = whole
        self._holding = False
        self._microstep_m = microstep_m
        self._rows: list[dict[str, float]] = []
        self._line = schedule.program.ops[0].span.line

    def add(self, sample: Sample) -> None:
        before, self._unsure = self._unsure, None if sample.one_moment else sample
        if before is not None:
            same = before.line == sample.line
            known = [n for n in AXES if same and before.command_u[n] == sample.command_u[n]]
            self._keep(before, known)
        if sample.one_moment:
            self._keep(sample, AXES)
        if len(self._rows) >= _HELD_ROWS and not self._holding:
            self._write()

    def _keep(self, sample: Sample, known: Sequence[int]) -> None:
        """Buffer a sample with the commands of the axes in `known`."""
        self._line = sample.line or self._line
        row = {"time_s": sample.time_s, "line": float(self._line)}
        row |= {f"command_{n}_m": sample.command_u[n] * self._microstep_m for n in known}
        row |= {f"position_{n}_m": u * self._microstep_m for n, u in sample.seen_u.items()}
        self._rows.append(row)
        self._seen({name: row.get(name, np.nan) for name in self._names})
        self._first_s = self._first_s if self._count else sample.time_s
        self._last_s = sample.time_s
        self._count += 1

    @property
    def rate_hz(self) -> float:
        """The mean rate of the samples; 0 for fewer than two."""
        span_s = self._last_s - self._first_s
        return (self._count - 1) / span_s if span_s > 0 else 0.0

    def hold(self) -> None:
        """Buffer samples until `close`, so that a slow or failing sink cannot delay a stop."""
        self._holding = True

    def close(self) -> None:
        """Write all samples; DataError if the sink cannot."""
        unsure, self._unsure = self._unsure, None
        if unsure is not None:
            self._keep(unsure, ())
        self._write()

    def _write(self) -> None:
        if not self._rows or self._sink is None:
            return
        columns = {n: np.array([row.get(n, np.nan) for row in self._rows]) for n in self._names}
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
