"""A slide that goes where it is told, in closed form; straight lines between the rows."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]


def readings(
    columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Effects
) -> Floats:
    """Place (m), shape (1, rows), for the columns `time_s` and `command_m`; no numbers.

    The effects of the command act in the order scale, delay, lag, backlash.
    """
    t, x = columns["time_s"], columns["command_m"]
    if own := effects.get("scale"):
        x = x * (1 + own["k"])
    if own := effects.get("delay"):
        x = np.interp(t - own["d"], t, x)
    if own := effects.get("lag"):
        x = behind(t, x, own["tau"])
    if own := effects.get("backlash"):
        x = played(x, own["w"], own.get("begun", 0.0))
    return (x + _read(t, x, effects))[None]


def _read(t: Floats, x: Floats, effects: Effects) -> Floats:
    """Errors of the sensor (m), shape (rows,)."""
    added = np.zeros(len(t))
    if own := effects.get("periodic_error"):
        added += _wave(x, own)
    if own := effects.get("periodic_in_time"):
        added += _wave(t, own)
    if own := effects.get("drift"):
        added += own["r"] * t
    if own := effects.get("bending_drift"):
        added += own["q2"] * t**2 + own["q3"] * t**3
    if own := effects.get("bow"):
        added += own["q"] * (x - own["middle"]) ** 2
    if own := effects.get("bent scale"):
        added += own["q"] * (x - own["middle"]) ** 3
    return added


def _wave(of: Floats, own: Mapping[str, float]) -> Floats:
    angle = 2 * math.pi * of / own["P"]
    first = own["s"] * np.sin(angle) + own["c"] * np.cos(angle)
    found: Floats = first + own.get("s2", 0.0) * np.sin(2 * angle)
    return found + own.get("c2", 0.0) * np.cos(2 * angle)


def behind(t: Floats, x: Floats, tau: float) -> Floats:
    """A lag of the first order of straight lines between the rows, in closed form."""
    found, late = np.empty_like(x), float(x[0])
    for i in range(len(x) - 1):
        found[i] = late
        step = float(t[i + 1] - t[i])
        slope = float(x[i + 1] - x[i]) / step
        late = (late - x[i] + slope * tau) * math.exp(-step / tau) + x[i] + slope * (step - tau)
    found[-1] = late
    return found


def played(x: Floats, width: float, begun: float) -> Floats:
    """The place behind a play; `begun` is where in it the place is at first.

    From -1, taken up in the direction of the first motion, to 1.
    """
    moves = x[x != x[0]]
    way = math.copysign(1.0, moves[0] - x[0]) if len(moves) else 1.0
    found, place = np.empty_like(x), float(x[0]) + begun * way * width / 2
    for i, target in enumerate(x.tolist()):
        place = min(max(place, target - width / 2), target + width / 2)
        found[i] = place
    return found
