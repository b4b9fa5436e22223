"""The four velocity profiles of chapter 4.1 in closed form, without state.

Lengths are in any one unit (the schedule uses microsteps), times in seconds. Formulas
are those of the source after its corrections: Tables 4.1 to 4.4, equations 4.14 and
4.15 are wrong as printed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class Shape(StrEnum):
    TRAPEZOID = "trapezoid"
    TRIANGLE = "triangle"
    SMOOTH = "smooth"
    PARABOLA = "parabola"


_CURVED = (Shape.SMOOTH, Shape.PARABOLA)


class State(NamedTuple):
    """Position, velocity and acceleration at one time."""

    position: float
    velocity: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class Segment:
    """A cubic of time, valid from `start_s` to `end_s`.

    position = x + v τ + a τ²/2 + j τ³/6 with τ = t - anchor_s. A braking segment is
    anchored at its end, so that the position there is the target with no rounding.
    """

    start_s: float
    end_s: float
    anchor_s: float
    x: float
    v: float
    a: float
    j: float

    def position(self, t: float) -> float:
        """The position of the state at `t`."""
        tau = t - self.anchor_s
        return self.x + tau * (self.v + tau * (self.a / 2 + tau * self.j / 6))

    def acceleration(self, t: float) -> float:
        """The acceleration of the state at `t`."""
        return self.a + (t - self.anchor_s) * self.j

    def state(self, t: float) -> State:
        tau = t - self.anchor_s
        return State(
            self.position(t),
            self.v + tau * (self.a + tau * self.j / 2),
            self.acceleration(t),
        )


@dataclass(frozen=True, slots=True)
class Profile:
    """One point-to-point move: two equal ramps and a cruise between them.

    `velocity` and `acceleration` are the set values, `peak_velocity` the one reached;
    `acceleration` is held through the ramps, or is where a parabolic ramp starts.
    """

    shape: Shape
    distance: float
    velocity: float
    acceleration: float
    peak_velocity: float
    ramp_s: float
    cruise_s: float

    @property
    def duration_s(self) -> float:
        return 2 * self.ramp_s + self.cruise_s

    @property
    def jerk(self) -> float:
        """Rate of change of acceleration in both ramps; 0 or negative."""
        return -self.acceleration / self.ramp_s if self.shape in _CURVED and self.ramp_s else 0.0

    def segments(
        self, start_s: float = 0.0, start: float = 0.0, stroke: float | None = None
    ) -> tuple[Segment, ...]:
        """The move as segments from `start_s` and `start`; empty ones are left out.

        `stroke` (signed, default the distance) is what this axis covers in the move:
        a minor axis of a coordinated move runs the major's profile scaled.
        """
        if not self.distance:
            return ()
        stroke = self.distance if stroke is None else stroke
        scale = stroke / self.distance
        a, j, peak = self.acceleration * scale, self.jerk * scale, self.peak_velocity * scale
        cruise_from, brake_from = start_s + self.ramp_s, start_s + self.ramp_s + self.cruise_s
        end_s = start_s + self.duration_s
        ramped = (stroke - peak * self.cruise_s) / 2
        parts = (
            Segment(start_s, cruise_from, start_s, start, 0.0, a, j),
            Segment(cruise_from, brake_from, cruise_from, start + ramped, peak, 0.0, 0.0),
            Segment(brake_from, end_s, end_s, start + stroke, 0.0, -a, j),
        )
        return tuple(part for part in parts if part.end_s > part.start_s)

    def state(self, t: float) -> State:
        """Position, velocity and acceleration `t` seconds after the start of the move."""
        if t <= 0:
            return State(0.0, 0.0, self.acceleration if t == 0 else 0.0)
        if t >= self.duration_s:
            return State(self.distance, 0.0, -self.acceleration if t == self.duration_s else 0.0)
        return next(s for s in reversed(self.segments()) if s.start_s <= t).state(t)


def plan_profile(
    distance: float, velocity: float, acceleration: float, parabolic: bool = False
) -> Profile:
    """The profile of a move over `distance` >= 0 with `velocity` and `acceleration` > 0.

    Trapezoid (eq. 4.2, 4.8) from a distance of V²/a (eq. 4.9); smooth (eq. 4.12, C.22)
    from 8V²/(3a) (eq. 4.14 corrected); below that triangle (eq. 4.11) and parabola
    (eq. C.40, 4.15 corrected: v = a t - a t²/T).
    """
    if distance < 0 or velocity <= 0 or acceleration <= 0:
        raise ValueError("a profile needs distance >= 0, velocity > 0 and acceleration > 0")
    ramp_s = (2 if parabolic else 1) * velocity / acceleration
    ramps = (8 / 3 if parabolic else 1) * velocity**2 / acceleration
    if distance >= ramps:
        shape = Shape.SMOOTH if parabolic else Shape.TRAPEZOID
        cruise_s = (distance - ramps) / velocity
        return Profile(shape, distance, velocity, acceleration, velocity, ramp_s, cruise_s)
    if parabolic:
        half_s = math.sqrt(6 * distance / acceleration) / 2
        peak = math.sqrt(6 * distance * acceleration) / 4
        shape = Shape.PARABOLA
    else:
        half_s = math.sqrt(distance / acceleration)
        peak = math.sqrt(distance * acceleration)
        shape = Shape.TRIANGLE
    return Profile(shape, distance, velocity, acceleration, min(peak, velocity), half_s, 0.0)


# -- a slip of units --------------------------------------------------------------------------
# Slips in writing a motion, recognised by what they lead to.

# No motor of this kind reaches its velocity in less time.
_SHORTEST_RAMP_S = 5e-3
_MS_PER_S = 1000


def per_millisecond(acceleration: float, velocity: float, axis: int, unit: str) -> str | None:
    """Hint for an acceleration that was probably meant per second, else None.

    `acceleration` (in `unit`/s²) and `velocity` (in `unit`/s) are those of a move that stalls.
    """
    if velocity >= acceleration * _SHORTEST_RAMP_S:
        return None
    written = acceleration / _MS_PER_S
    return (
        f"ACC is in {unit}/s per millisecond: for {written:g} {unit}/s² write "
        f"`ACC{axis} {written / _MS_PER_S:g}`"
    )
