"""Velocity profiles as segments of constant jerk, in closed form.

A segment is (duration, v, a, j) with the speed v + a t + j t²/2. Lengths are in any one
unit. Limits and the parabola's shape are those of the errata: a smooth move needs
8 V²/(3 a), a parabola lasts √(6 s/a).
"""

from __future__ import annotations

import math

Segment = tuple[float, float, float, float]


def profile_segments(
    distance: float, speed: float, acceleration: float, parabolic: bool
) -> list[Segment]:
    """The segments of a move from rest to rest; distance, speed and acceleration > 0."""
    shape = _parabolic if parabolic else _trapezoidal
    return [segment for segment in shape(distance, speed, acceleration) if segment[0] > 0]


def duration_s(parts: list[Segment]) -> float:
    """Duration of all segments together."""
    return sum(part[0] for part in parts)


def _trapezoidal(s: float, v: float, a: float) -> list[Segment]:
    """Trapezoid, or a triangle if the speed cannot be reached."""
    peak = min(v, math.sqrt(s * a))
    ramp = peak / a
    cruise = max(0.0, s - peak * ramp) / peak
    if peak < v:
        cruise = 0.0
    return [(ramp, 0.0, a, 0.0), (cruise, peak, 0.0, 0.0), (ramp, peak, -a, 0.0)]


def _parabolic(s: float, v: float, a: float) -> list[Segment]:
    """Ramps with acceleration falling linearly from a to 0, or a single parabola of speed."""
    ramp = 2 * v / a
    ramps = 8 * v * v / (3 * a)
    if s < ramps:
        whole = math.sqrt(6 * s / a)
        return [(whole, 0.0, a, -2 * a / whole)]
    jerk = -a / ramp
    return [(ramp, 0.0, a, jerk), ((s - ramps) / v, v, 0.0, 0.0), (ramp, v, 0.0, jerk)]
