"""The command of a run: planned, as effects change it, and as arrays.

The arrays are what the integrator and the recorded columns read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import fields
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from mopro.effects import Active
from mopro.machine import Machine
from mopro.motion import Schedule, Segment, plan
from mopro.motion.track import Track
from mopro.plant.repetition import Course
from mopro.program import Program

Floats = NDArray[np.float64]
# Interval of the samples that a changed command is made of, and the most of them.
_SAMPLED_S, _MOST_SAMPLES = 1e-3, 200_000

_ROW = attrgetter(*(field.name for field in fields(Segment)))


def plan_with_effects(
    program: Program, machine: Machine, active: Sequence[Active], for_s: float | None = None
) -> Schedule:
    """The schedule of `program` on `machine`; raises MotionError, as `plan` does."""
    for a in active:
        program = a.effect.program(program, *a.values)
    return change_schedule(plan(program, for_s, machine.travel_u()), active)


def change_schedule(schedule: Schedule, active: Sequence[Active]) -> Schedule:
    """`schedule` as effects of the command change it."""
    for a in active:
        schedule = a.effect.schedule(schedule, *a.values)
    return schedule


class CommandTable:
    """One axis' segments in rows, the rests between them filled in, from time 0 on.

    Columns of `coefficients`: anchor time (s), x, v, a, j in microsteps; `starts_s` are
    the rows' first times.
    """

    def __init__(self, track: Track) -> None:
        rows = np.array([_ROW(segment) for segment in _with_rests(track)])
        self.starts_s: Floats = rows[:, 0]
        self.coefficients: Floats = np.ascontiguousarray(rows[:, 2:].T)

    @classmethod
    def _of_rows(cls, starts_s: Floats, coefficients: Floats) -> CommandTable:
        """A table of these rows, which are no track's."""
        table = cls.__new__(cls)
        table.starts_s, table.coefficients = starts_s, coefficients
        return table

    @classmethod
    def of(
        cls,
        schedule: Schedule,
        axis: int,
        active: Iterable[Active],
        microstep_m: float,
        averaged_s: float = 0.0,
    ) -> CommandTable:
        """The command of `axis` in a schedule, as the `active` effects on that axis change it.

        Ticks up to `averaged_s` between which it moves evenly are `averaged`.
        """
        table = cls(schedule.tracks[axis])
        for a in active:
            table = table.changed(a, microstep_m, schedule.duration_s)
            interval_s, interpolate = a.effect.tick_s(*a.values)
            if interpolate and 0 < interval_s <= averaged_s:
                table = table.averaged(interval_s)
            elif interval_s > 0:
                table = table.ticked(interval_s, interpolate, schedule.duration_s)
        return table

    def averaged(self, interval_s: float) -> CommandTable:
        """As `ticked` with even motion in each tick, less what that sways about its own average.

        Chords of a motion that is late by the tick T are a T²/12 beyond it on average.
        """
        anchor, x, v, a, j = self.coefficients
        sag = interval_s**2 / 12
        moved = np.array([anchor + interval_s, x + sag * a, v + sag * j, a, j])
        still = np.array([0.0, float(self.position_u(np.zeros(1))[0]), 0.0, 0.0, 0.0])
        return self._of_rows(
            np.append(0.0, self.starts_s + interval_s), np.column_stack([still, moved])
        )

    def ticked(self, interval_s: float, interpolate: bool, until_s: float) -> CommandTable:
        """The command of a controller that updates it every `interval_s`.

        See effects.command; `until_s` ends a motion without end.
        """
        ends_s = np.minimum(np.append(self.starts_s[1:], np.inf), until_s)
        moving = self.coefficients[2:].any(axis=0)
        spans = zip(self.starts_s[moving], ends_s[moving], strict=True)
        ticks = np.unique(
            np.concatenate(
                [[0.0]]
                + [
                    np.arange(math.floor(a / interval_s), math.ceil(b / interval_s) + 3)
                    for a, b in spans
                ]
            )
        )
        here = self.position_u(ticks * interval_s)
        before = self.position_u(np.maximum(ticks - 1, 0) * interval_s)
        starts_s, still = ticks * interval_s, np.zeros_like(here)
        start, speed = (before, (here - before) / interval_s) if interpolate else (here, still)
        if not interpolate:
            start = np.floor(start + 0.5)
        return self._of_rows(starts_s, np.array([starts_s, start, speed, still, still]))

    def changed(self, active: Active, microstep_m: float, until_s: float) -> CommandTable:
        """The command as an effect changes it, by cubics between close samples; see Effect.command.

        From `until_s` on it rests.
        """
        if not active.effect.changes_command:
            return self
        count = min(max(math.ceil(until_s / _SAMPLED_S), 2), _MOST_SAMPLES) + 1
        time_s = np.linspace(0.0, until_s, count)
        place_m = self.position_u(time_s) * microstep_m
        x = active.effect.command(place_m, time_s, *active.values) / microstep_m
        v, h = np.gradient(x, time_s), float(time_s[1])
        v[0] = v[-1] = 0.0
        slope, bend = np.diff(x) / h, v[:-1] + v[1:]
        a = 2 * (3 * slope - bend - v[:-1]) / h
        j = 6 * (bend - 2 * slope) / (h * h)
        rows = np.array([time_s, x, v, np.append(a, 0.0), np.append(j, 0.0)])
        return self._of_rows(time_s, rows)

    def rows(self, microstep_m: float) -> Floats:
        """A row for each segment, as the kernel takes it (see kernel.motion.Segment).

        Anchor time (s), coefficients of the position (microsteps) and of the speed (m/s), and
        1 where the command is at rest.
        """
        anchor, x, v, a, j = self.coefficients
        moving = self.coefficients[2:].any(axis=0)
        speed = v * microstep_m, a * microstep_m, j / 2 * microstep_m
        return np.array([anchor, x, v, a / 2, j / 6, *speed, ~moving]).T.copy()

    @property
    def course(self) -> Course:
        """The rows, each by its own time: two that move alike are equal."""
        anchor, *motion = self.coefficients
        return Course(self.starts_s, np.array([anchor - self.starts_s, *motion]).T)

    def rows_at(self, time_s: Floats) -> NDArray[np.intp]:
        """The row that holds at each time, and just after it."""
        return np.searchsorted(self.starts_s, time_s, side="right") - 1

    def rows_along(self, time_s: Floats) -> NDArray[np.intp]:
        """As `rows_at`, for times that ascend: faster for many."""
        return rows_along(self.starts_s, time_s)

    def corners_s(self, start_s: float, end_s: float) -> Floats:
        """The row changes strictly between two times."""
        first = np.searchsorted(self.starts_s, start_s, side="right")
        return self.starts_s[first : np.searchsorted(self.starts_s, end_s, side="left")]

    def at_rest(self, time_s: float) -> bool:
        """True if the command is at rest from `time_s` on."""
        row = int(self.rows_at(np.array([time_s]))[0])
        return row == len(self.starts_s) - 1 and not self.coefficients[2:, row].any()

    def position_u(self, time_s: Floats) -> Floats:
        """The commanded position in microsteps, before it is rounded to whole ones."""
        anchor, x, v, a, j = self.coefficients.take(self.rows_at(time_s), axis=1)
        tau = time_s - anchor
        position: Floats = x + tau * (v + tau * (a / 2 + tau * j / 6))
        return position


def rows_along(starts_s: Floats, time_s: Floats) -> NDArray[np.intp]:
    """The last of the ascending `starts_s` that is not after each of the ascending times (s).

    -1 before the first. The few starts are looked for among the many times, not the reverse.
    """
    counts = np.diff(np.searchsorted(time_s, starts_s), prepend=0, append=len(time_s))
    return np.repeat(np.arange(-1, len(starts_s)), counts)


def _with_rests(track: Track) -> list[Segment]:
    """The segments of `track` and a rest wherever it has none, the last one without end."""
    filled: list[Segment] = []
    now_s, position = 0.0, 0.0
    for segment in track.segments:
        if segment.start_s > now_s:
            filled.append(_rest(now_s, segment.start_s, position))
        filled.append(segment)
        now_s = segment.end_s
        position = segment.position(now_s) if math.isfinite(now_s) else position
    if math.isfinite(now_s):
        filled.append(_rest(now_s, math.inf, position))
    return filled


def _rest(start_s: float, end_s: float, position: float) -> Segment:
    return Segment(start_s, end_s, start_s, position, 0.0, 0.0, 0.0)


def hermite(u: Floats, start: Floats, end: Floats, rise: Floats, fall: Floats) -> Floats:
    """The cubic Hermite polynomial at `u` of its interval, from 0 to 1.

    `start` and `end` are its values, `rise` and `fall` its slopes there times the
    interval's length. Only the intervals asked for are worked out: scipy's spline, which
    prepares them all, takes two to twenty times as long.
    """
    curve: Floats = (
        start * (1 + 2 * u) * (1 - u) ** 2
        + rise * u * (1 - u) ** 2
        + end * u**2 * (3 - 2 * u)
        - fall * u**2 * (1 - u)
    )
    return curve
