"""Events that stop a machine: limit switches, the platen's edges and overheating.

A switch that a motion runs into makes the controller brake all axes at their set rate
and give the program up; heat beyond the rating makes the drive switch its current off.
The switch is seen on the commanded position, as for seeking. The operator is taken to
have placed the forcer where the program's travel lies in the middle of the platen, as the
listings' comments ask ("start motor in ..."), except for programs that seek a switch,
which start in the middle themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mopro.effects import Active
from mopro.effects.forces import PLATEN_EDGE
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.motion.track import Track
from mopro.plant.command_table import Floats

_TOLERANCE_U = 1.0

Ranges = dict[int, tuple[float, float]]


@dataclass(frozen=True)
class Trip:
    """Event that stopped the machine: `limit-switch` of `axis`, or `over-temperature`."""

    kind: str
    time_s: float
    line: int
    axis: int | None = None

    def as_json(self) -> dict[str, Any]:
        return {"kind": self.kind, "time_s": self.time_s, "line": self.line, "axis": self.axis}


def switches_u(schedule: Schedule, travel_u: Mapping[int, tuple[float, float]]) -> Ranges:
    """Limit switches (low, high) of each axis, in microsteps from the program's start."""
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
    ends = [s.position(t) for s in track.segments for t in (s.start_s, s.end_s)]
    ends = [end for end in ends if math.isfinite(end)]
    return min([0.0, *ends]), max([0.0, *ends])


def limit_trip(schedule: Schedule, switches: Ranges) -> Trip | None:
    """The first time at which a command runs over a switch."""
    if schedule.program.seeks_switch:
        return None
    found = [
        Trip("limit-switch", time_s, line_at(schedule, time_s), axis)
        for axis, (low, high) in switches.items()
        if math.isfinite(time_s := _leaves_s(schedule, axis, low, high))
    ]
    return min(found, key=lambda trip: trip.time_s, default=None)


def _leaves_s(schedule: Schedule, axis: int, low_u: float, high_u: float) -> float:
    track, until_s = schedule.tracks[axis], schedule.duration_s
    return track.leaves_s(low_u - _TOLERANCE_U, high_u + _TOLERANCE_U, until_s)


def line_at(schedule: Schedule, time_s: float) -> int:
    lines = [line for t, line in schedule.activity if t <= time_s]
    return lines[-1] if lines else schedule.program.ops[0].span.line


def heat_trip(
    schedule: Schedule, temperature_C: Floats, times_s: Floats, rated_C: float
) -> Trip | None:
    """The first of `times_s` at which the forcer is above its rated temperature."""
    hot = np.flatnonzero(temperature_C > rated_C)
    if not len(hot):
        return None
    time_s = float(times_s[hot[0]])
    return Trip("over-temperature", time_s, line_at(schedule, time_s))


def platen_edges(machine: Machine, switches: Ranges) -> list[Active]:
    """The platen's edges, beyond each axis' switches."""
    scale, beyond = machine.microstep_m, machine.limits.overtravel_m
    return [
        Active(PLATEN_EDGE, (low * scale - beyond, high * scale + beyond), (axis,))
        for axis, (low, high) in switches.items()
    ]
