"""What stops a machine: its limit switches, the platen's edges and its own heat.

A switch that a motion runs into makes the controller brake all axes at their set rate
and give the program up; heat beyond the rating makes the drive switch its current off.
The switch is seen on the commanded position, as for seeking. The operator is taken to
have placed the forcer where the program's way lies in the middle of the platen, as the
listings' comments ask ("start motor in ..."), except for programs that seek a switch,
which start in the middle themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mopro.effects.base import Effect, Parameter, Stage
from mopro.motion import Schedule
from mopro.motion.track import Track, brake
from mopro.plant.command_table import Floats

SHOWN_AFTER_S = 0.5
_TOLERANCE_U = 1.0

Ranges = dict[int, tuple[float, float]]


@dataclass(frozen=True)
class Trip:
    """What stopped the machine: `limit-switch` of `axis`, or `over-temperature`."""

    kind: str
    time_s: float
    line: int
    axis: int | None = None

    def as_json(self) -> dict[str, Any]:
        return {"kind": self.kind, "time_s": self.time_s, "line": self.line, "axis": self.axis}


class PlatenEdge(Effect):
    """The stop that the forcer runs into beyond its limit switch.

    F = -K (x - edge) - C ẋ outside of [low, high] (m), a stiff and well damped contact.
    Source: assumed. Not in the catalogue: every machine has it, few runs meet it.
    """

    name = "platen_edge"
    stage = Stage.DYNAMICS
    parameters = tuple(
        Parameter(n, "m", "length", 0.0, (-1, 1), -math.inf, math.inf, f"{n} edge")
        for n in ("low", "high")
    )

    @staticmethod
    def force(x: float, v: float, low: float, high: float) -> float:
        if low <= x <= high:
            return 0.0
        edge = high if x > high else low
        return -2.0e6 * (x - edge) - 2.0e3 * v


def switches_u(schedule: Schedule, travel_u: Mapping[int, tuple[float, float]]) -> Ranges:
    """Where each axis meets its switches, in microsteps from the program's start."""
    seeking = schedule.program.seeks_switch
    found: Ranges = {}
    for axis, (low, high) in travel_u.items():
        least, most = (0.0, 0.0) if seeking else _range_u(schedule.tracks[axis])
        shift = (least + most) / 2
        if most - least > high - low:
            shift = least - low if most >= -least else most - high
        found[axis] = (low + shift, high + shift)
    return found


def _range_u(track: Track) -> tuple[float, float]:
    ends = [s.state(t).position for s in track.segments for t in (s.start_s, s.end_s)]
    ends = [end for end in ends if math.isfinite(end)]
    return min([0.0, *ends]), max([0.0, *ends])


def limit_trip(schedule: Schedule, switches: Ranges) -> Trip | None:
    """The first time at which a command runs over a switch."""
    if schedule.program.seeks_switch:
        return None
    found = [
        Trip("limit-switch", time_s, _line_at(schedule, time_s), axis)
        for axis, (low, high) in switches.items()
        if math.isfinite(time_s := _leaves_s(schedule, axis, low, high))
    ]
    return min(found, key=lambda trip: trip.time_s, default=None)


def _leaves_s(schedule: Schedule, axis: int, low_u: float, high_u: float) -> float:
    track, until_s = schedule.tracks[axis], schedule.duration_s
    return track.leaves_s(low_u - _TOLERANCE_U, high_u + _TOLERANCE_U, until_s)


def _line_at(schedule: Schedule, time_s: float) -> int:
    lines = [line for t, line in schedule.activity if t <= time_s]
    return lines[-1] if lines else schedule.program.ops[0].span.line


def braked(schedule: Schedule, trip: Trip) -> Schedule:
    """The schedule up to the trip, every axis then braking to rest."""
    moves = tuple(m for m in schedule.moves if m.start_s < trip.time_s)
    tracks, ends_s = {}, [trip.time_s]
    for axis, track in schedule.tracks.items():
        rates = [m.profile.acceleration for m in moves if axis in m.axes]
        state = track.state(trip.time_s)
        tracks[axis] = Track()
        tracks[axis].add(track.segments)
        tracks[axis].cut(trip.time_s)
        if rates and state.velocity:
            segments = brake(trip.time_s, state, rates[-1])
            tracks[axis].add(segments)
            ends_s += [segment.end_s for segment in segments]
    return ended(schedule, max(ends_s) + SHOWN_AFTER_S, moves, tracks)


def ended(
    schedule: Schedule, duration_s: float, moves: tuple[Any, ...], tracks: Mapping[int, Track]
) -> Schedule:
    """The schedule given up; what was running then is the last line that is shown."""
    activity = [(t, line) for t, line in schedule.activity if t <= duration_s]
    return replace(
        schedule,
        duration_s=duration_s,
        complete=False,
        moves=moves,
        tracks=tracks,
        activity=activity,
    )


def heat_trip(
    schedule: Schedule, temperature_C: Floats, times_s: Floats, rated_C: float
) -> Trip | None:
    """The first of `times_s` at which the forcer is hotter than it is rated for."""
    hot = np.flatnonzero(temperature_C > rated_C)
    if not len(hot):
        return None
    time_s = float(times_s[hot[0]])
    return Trip("over-temperature", time_s, _line_at(schedule, time_s))


def frozen(schedule: Schedule, trip: Trip) -> Schedule:
    """The schedule given up where the drive goes dead; the command stays where it was."""
    tracks = {}
    for axis, track in schedule.tracks.items():
        tracks[axis] = Track()
        tracks[axis].add(track.segments)
        tracks[axis].cut(trip.time_s)
    moves = tuple(m for m in schedule.moves if m.start_s < trip.time_s)
    duration_s = min(schedule.duration_s, trip.time_s + SHOWN_AFTER_S)
    return ended(schedule, duration_s, moves, tracks)
