"""The platen from above, with its limit switches, as the scripts read it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.plant import switches_u


def platen_json(
    machine: Machine, schedule: Schedule, places: Mapping[int, tuple[str, str]]
) -> dict[str, Any]:
    """Platen, forcer and switches in metres from the place where the program begins.

    `places`: the track and channel that tell the position (m) of each axis.
    """
    return platen_of(machine, switches_u(schedule, machine.travel_u()), places)


def platen_of(
    machine: Machine,
    travel_u: Mapping[int, tuple[float, float]],
    places: Mapping[int, tuple[str, str]],
) -> dict[str, Any]:
    """As `platen_json`, for limit switches at `travel_u` (microsteps)."""
    travel = {
        str(axis): [low * machine.microstep_m, high * machine.microstep_m]
        for axis, (low, high) in travel_u.items()
    }
    return {
        "length": machine.platen.length_m,
        "width": machine.platen.width_m,
        "side": machine.heat.forcer_side_m,
        "travel": travel,
        "position": {
            str(axis): {"track": track, "channel": channel}
            for axis, (track, channel) in places.items()
        },
    }
