"""The current of a drive over a motion that is known: an inertia, drags and frictions."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.blind.reference.kinematic import behind

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]


def readings(
    columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Effects
) -> Floats:
    """Current (A), shape (1, rows), for the columns `time_s`, `angle_rad`, `speed`, `acceleration`.

    Speed (rad/s) and acceleration (rad/s²) are those of the motion itself, which the log does not
    have. Numbers `inertia` (A s²) and `damping` (A s).
    """
    t, x = columns["time_s"], columns["angle_rad"]
    v, a = columns["speed"], columns["acceleration"]

    def of(name: str, parameter: str) -> float:
        return float(effects.get(name, {}).get(parameter, 0.0))

    current = (numbers["inertia"] + of("added_mass", "dm")) * a
    current = current + (numbers["damping"] + of("viscous_drag", "b")) * v
    current += of("quadratic_drag", "d") * v * np.abs(v) + of("cubic_damping", "b3") * v**3
    current += of("stiffness", "k") * x + of("cubic_stiffness", "k3") * x**3
    current += of("bias_force", "g") + of("drift", "r") * t
    current += of("gravity", "gs") * np.sin(x) + of("gravity", "gc") * np.cos(x)
    if own := effects.get("cogging"):
        angle = 2 * math.pi * x / own["P"]
        current += own["s"] * np.sin(angle) + own["c"] * np.cos(angle)
    if own := effects.get("dry_friction"):
        current += _friction(v, own)
    current += of("friction of place", "F1") * np.abs(x) * np.sign(v)
    if tau := of("sensor_lag", "tau"):
        current = behind(t, current, tau)
    if d := of("delay", "d"):
        current = np.interp(t - d, t, current)
    return current[None]


def _friction(v: Floats, own: Mapping[str, float]) -> Floats:
    limit = own["Fc"] + own.get("Fs", 0.0) * np.exp(-((v / own.get("vs", 1.0)) ** 2))
    side = v / np.hypot(v, own["v0"]) if own.get("v0") else np.sign(v)
    found: Floats = limit * side
    return found
