"""The command of one axis in time: an ordered run of segments with rests between them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import replace

from mopro.motion.profile import Segment, State

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
        return State(segment.state(segment.end_s).position, 0.0, 0.0)

    def leaves_s(self, low: float, high: float, until_s: float = math.inf) -> float:
        """First time (s) at which the command passes `low` or `high`; inf if not by `until_s`.

        Each segment is monotonic; the one that passes is bisected to a microsecond.
        """
        for segment in self.segments:
            start_s, end_s = segment.start_s, min(segment.end_s, until_s)
            if start_s >= until_s or math.isinf(end_s):
                continue
            first, last = segment.state(start_s).position, segment.state(end_s).position
            if not ((last > high and last > first) or (last < low and last < first)):
                continue
            while end_s - start_s > _TIME_RESOLUTION_S:
                middle_s = (start_s + end_s) / 2
                inside = low <= segment.state(middle_s).position <= high
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
