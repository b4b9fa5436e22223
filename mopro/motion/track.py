"""The command of one axis in time, and the registers that it comes from.

The command is an ordered run of segments with rests between them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from fractions import Fraction

from mopro.motion.profile import Segment, State
from mopro.program import ir
from mopro.source import Span

_TIME_RESOLUTION_S = 1e-6


class Track:
    """Segments that begin where the last ended; outside of them the axis rests."""

    def __init__(self) -> None:
        self.segments: list[Segment] = []

    def add(self, segments: Iterable[Segment]) -> None:
        self.segments.extend(segments)

    def cut(self, t: float) -> None:
        """Forget what was commanded after `t`."""
        while self.segments and self.segments[-1].start_s >= t:
            self.segments.pop()
        if self.segments and self.segments[-1].end_s > t:
            self.segments[-1] = replace(self.segments[-1], end_s=t)

    def state(self, t: float) -> State:
        """The commanded state at `t`; position 0 before the first segment."""
        index = bisect_right(self.segments, t, key=lambda segment: segment.start_s) - 1
        if index < 0:
            return State(0.0, 0.0, 0.0)
        segment = self.segments[index]
        if t <= segment.end_s:
            return segment.state(t)
        return State(segment.position(segment.end_s), 0.0, 0.0)

    def leaves_s(self, low: float, high: float, until_s: float = math.inf) -> float:
        """First time (s) at which the command passes `low` or `high`; inf if not by `until_s`.

        Each segment is monotonic; the one that passes is bisected to a microsecond.
        """
        for segment in self.segments:
            start_s, end_s = segment.start_s, min(segment.end_s, until_s)
            if start_s >= until_s or math.isinf(end_s):
                continue
            first, last = segment.position(start_s), segment.position(end_s)
            if not ((last > high and last > first) or (last < low and last < first)):
                continue
            while end_s - start_s > _TIME_RESOLUTION_S:
                middle_s = (start_s + end_s) / 2
                inside = low <= segment.position(middle_s) <= high
                start_s, end_s = (middle_s, end_s) if inside else (start_s, middle_s)
            return end_s
        return math.inf


def change_velocity(start_s: float, start: State, velocity: float, rate: float) -> list[Segment]:
    """Segments from `start` to `velocity` at acceleration `rate` > 0, then on without end."""
    change = velocity - start.velocity
    ramp_s = abs(change) / rate
    a = math.copysign(rate, change)
    ramp = Segment(start_s, start_s + ramp_s, start_s, start.position, start.velocity, a, 0.0)
    reached = ramp.state(ramp.end_s).position
    cruise = Segment(ramp.end_s, math.inf, ramp.end_s, reached, velocity, 0.0, 0.0)
    return [ramp, cruise] if ramp_s > 0 else [cruise]


def brake(start_s: float, start: State, rate: float) -> list[Segment]:
    """A braking segment from `start` to rest, at acceleration `rate` but for rounding.

    Rest is on a whole microstep, to which the rate is fitted.
    """
    speed = abs(start.velocity)
    target = round(start.position + math.copysign(speed**2 / (2 * rate), start.velocity))
    distance = abs(target - start.position)
    if not speed or not distance:
        return []
    duration_s = 2 * distance / speed
    end_s = start_s + duration_s
    return [Segment(start_s, end_s, end_s, float(target), 0.0, -start.velocity / duration_s, 0.0)]


# -- registers --------------------------------------------------------------------------------
# The registers of one axis: its settings, its target and its motion.

# A motion this close to its end has ended: far below one sample, far above rounding.
_TIME_TOLERANCE_S = 1e-9


@dataclass
class AxisRegisters:
    """Positions are exact rationals in microsteps from the start, so nothing drifts.

    `endless_from_u` is where a motion without end began, while one is under way.
    """

    number: int
    microsteps_per_uu: Fraction | None = None
    velocity_uu_s: Fraction | None = None
    acceleration_uu_s2: Fraction | None = None
    parabolic: bool = False
    position_u: Fraction = Fraction(0)
    origin_u: Fraction = Fraction(0)
    target_u: Fraction | None = None
    track: Track = field(default_factory=Track)
    started_s: float = 0.0
    started_by: Span = field(default_factory=lambda: Span(1, 1, 1))
    busy_until_s: float = -math.inf
    endless_from_u: int | None = None

    @property
    def endless(self) -> bool:
        return self.endless_from_u is not None

    def moving(self, t: float) -> bool:
        return self.busy_until_s > t + _TIME_TOLERANCE_S

    def occupy(self, span: Span, start_s: float, end_s: float) -> None:
        self.started_by, self.started_s, self.busy_until_s = span, start_s, end_s

    def destination_u(self, op: ir.Move | ir.SetTarget) -> Fraction:
        """The position, in microsteps from the start, to which `op` sends the axis."""
        base_u = self.origin_u if op.absolute else self.position_u
        return base_u + op.distance_uu * self.units

    def missing(self, governs: bool) -> list[tuple[str, str, str]]:
        """Settings that a motion needs and that are not set: rule, name, example.

        An axis that follows another's profile (`governs` false) needs user units only.
        """
        missing = []
        if self.microsteps_per_uu is None:
            missing.append(("missing-units", "user units", f"UU{self.number}12500/1"))
        if governs and self.velocity_uu_s is None:
            missing.append(("missing-velocity", "velocity", f"VEL{self.number} 40.0"))
        if governs and self.acceleration_uu_s2 is None:
            missing.append(("missing-acceleration", "acceleration", f"ACC{self.number} 0.25"))
        return missing

    @property
    def units(self) -> Fraction:
        return _set(self.microsteps_per_uu)

    def velocity_u_s(self) -> float:
        return _product(_set(self.velocity_uu_s), self.units)

    def acceleration_u_s2(self) -> float:
        return _product(_set(self.acceleration_uu_s2), self.units)


# A quotient of whole numbers is rounded once, so these need no lowest terms.


def _product(a: Fraction, b: Fraction) -> float:
    return (a.numerator * b.numerator) / (a.denominator * b.denominator)


def quotient(a: Fraction, b: Fraction) -> float:
    """`float(a / b)`, to the last bit."""
    return (a.numerator * b.denominator) / (a.denominator * b.numerator)


def _set(register: Fraction | None) -> Fraction:
    assert register is not None, "`missing` is asked before each motion"
    return register
