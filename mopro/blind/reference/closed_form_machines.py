"""Machines beside the motor in closed form: a slide, and the current of a drive.

The slide goes where it is told, in straight lines between the rows. The drive moves as is known,
against its inertia, drags and frictions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from mopro.blind.reference.motor import Floats, Hidden, of

Columns = Mapping[str, Floats]


def slide(columns: Columns, numbers: Mapping[str, float], effects: Hidden) -> Floats:
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


def _read(t: Floats, x: Floats, effects: Hidden) -> Floats:
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


def _wave(along: Floats, own: Mapping[str, float]) -> Floats:
    angle = 2 * math.pi * along / own["P"]
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


def effort(columns: Columns, numbers: Mapping[str, float], effects: Hidden) -> Floats:
    """Current (A), shape (1, rows), for the columns `time_s`, `angle_rad`, `speed`, `acceleration`.

    Speed (rad/s) and acceleration (rad/s²) are those of the motion itself, which the log does not
    have. Numbers `inertia` (A s²) and `damping` (A s).
    """
    t, x = columns["time_s"], columns["angle_rad"]
    v, a = columns["speed"], columns["acceleration"]
    get = partial(of, effects)

    current = (numbers["inertia"] + get("added_mass", "dm")) * a
    current = current + (numbers["damping"] + get("viscous_drag", "b")) * v
    current += get("quadratic_drag", "d") * v * np.abs(v) + get("cubic_damping", "b3") * v**3
    current += get("stiffness", "k") * x + get("cubic_stiffness", "k3") * x**3
    current += get("bias_force", "g") + get("drift", "r") * t
    current += get("gravity", "gs") * np.sin(x) + get("gravity", "gc") * np.cos(x)
    if own := effects.get("cogging"):
        angle = 2 * math.pi * x / own["P"]
        current += own["s"] * np.sin(angle) + own["c"] * np.cos(angle)
    if own := effects.get("dry_friction"):
        current += _friction(v, own)
    current += get("friction of place", "F1") * np.abs(x) * np.sign(v)
    if tau := get("sensor_lag", "tau"):
        current = behind(t, current, tau)
    if d := get("delay", "d"):
        current = np.interp(t - d, t, current)
    return current[None]


def _friction(v: Floats, own: Mapping[str, float]) -> Floats:
    limit = own["Fc"] + own.get("Fs", 0.0) * np.exp(-((v / own.get("vs", 1.0)) ** 2))
    side = v / np.hypot(v, own["v0"]) if own.get("v0") else np.sign(v)
    found: Floats = limit * side
    return found
