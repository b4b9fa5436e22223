"""Converts a logged command to a schedule: cubic splines through the samples, and moves."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mopro.experiment.sawyer.trials import Floats, LoggedCommand
from mopro.machine import Machine
from mopro.motion import PlannedMove, Profile, Schedule, Segment, Shape, Stroke
from mopro.motion.track import Track
from mopro.program import AXES, Program
from mopro.source import Source, Span

# Line of a move that no statement commanded.
NO_LINE = 0
_PLACE = Span(NO_LINE, 1, 1)
_STILL_M = 1e-9
_SHORTEST_REST_S = 0.02
_PARKED = "logged command"


def schedule_of(command: LoggedCommand, machine: Machine) -> Schedule:
    """Schedule that follows the log, with its first position as origin.

    Rests of 20 ms and more are exact; each motion between two of them is one cubic spline
    through its samples. A move is a motion in one direction: it ends at a rest or a reversal.
    """
    tracks = {axis: Track() for axis in AXES}
    moves: list[PlannedMove] = []
    for axis, position_m in command.position_m.items():
        position_u = (position_m - position_m[0]) / machine.microstep_m
        for first, last in _motions(command.time_s, position_m):
            segments = _segments(command.time_s, position_u, first, last)
            tracks[axis].add(segments)
            moves += _moves(axis, segments)
    return Schedule(
        program=Program((), Source(_PARKED, "")),
        duration_s=float(command.time_s[-1]),
        complete=True,
        moves=tuple(sorted(moves, key=lambda move: move.start_s)),
        tracks=tracks,
        activity=[(0.0, NO_LINE)],
    )


def _motions(time_s: Floats, position_m: Floats) -> Iterator[tuple[int, int]]:
    """The first and the last sample of each motion."""
    moving = np.flatnonzero(np.abs(np.diff(position_m)) > _STILL_M)
    if not len(moving):
        return
    rests = np.flatnonzero(time_s[moving[1:]] - time_s[moving[:-1] + 1] > _SHORTEST_REST_S)
    starts = moving[np.concatenate([[0], rests + 1])]
    ends = moving[np.append(rests, len(moving) - 1)] + 1
    yield from zip(starts.tolist(), ends.tolist(), strict=True)


def _segments(time_s: Floats, position_u: Floats, first: int, last: int) -> list[Segment]:
    """A cubic for each sample interval; at a rest the velocity is zero."""
    from scipy.interpolate import CubicSpline  # takes a tenth of a second

    t, u = time_s[first : last + 1], position_u[first : last + 1]
    ends = ((1, 0.0), (1, 0.0))
    if first == 0 or last == len(time_s) - 1:
        # The log begins or ends during motion: the velocity there is unknown.
        ends = ((1, 0.0) if first else (2, 0.0), (1, 0.0) if last < len(time_s) - 1 else (2, 0.0))
    j, a, v, x = CubicSpline(t, u, bc_type=ends).c
    return [
        Segment(start, end, start, *state)
        for start, end, *state in zip(
            t[:-1].tolist(), t[1:].tolist(), x.tolist(), v.tolist(), (2 * a).tolist(),
            (6 * j).tolist(), strict=True,
        )
    ]  # fmt: skip


def _moves(axis: int, segments: list[Segment]) -> Iterator[PlannedMove]:
    """One PlannedMove for each direction; its profile has the totals, the track the motion."""
    directions = np.sign([s.state(s.end_s).position - s.x for s in segments])
    for part in _same_direction(directions):
        own = segments[part.start : part.stop]
        start_u, end_u = own[0].x, own[-1].state(own[-1].end_s).position
        duration_s = own[-1].end_s - own[0].start_s
        length = abs(end_u - start_u)
        peak = max(abs(s.state(s.start_s).velocity) for s in own)
        peak = max(peak, length / duration_s)
        rate = max(abs(s.a) for s in own)
        profile = Profile(Shape.TRAPEZOID, length, peak, rate, peak, 0.0, duration_s)
        stroke = Stroke(axis, round(start_u), round(end_u))
        yield PlannedMove(_PLACE, (stroke,), profile, own[0].start_s, length, Fraction(1))


def _same_direction(directions: NDArray[np.float64]) -> Iterator[range]:
    """Runs of segments in one direction; one that stands still belongs to the run before."""
    start, direction = 0, 0.0
    for i, here in enumerate(directions.tolist()):
        if here and direction and here != direction:
            yield range(start, i)
            start = i
        direction = here or direction
    yield range(start, len(directions))
