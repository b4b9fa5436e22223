"""Reader of program texts: the strokes of each axis in time, independent of mopro's compiler.

UU VEL ACC PARA MRI MR GO WX WT, labels and JUMP, comments; either letter case, the letter
O for the axis digit 0.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from fractions import Fraction

from mopro.blind.reference.motor import THESIS

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


_AXES = (1, 2)
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_STATEMENT = re.compile(
    rf"""\s*(?:
      :(?P<label>\w+)
    | UU(?P<uu>[0-2O])(?P<steps>\d+)/(?P<per>\d+)
    | (?P<set>VEL|ACC)(?P<set_axis>[0-2O])\s*(?P<value>{_NUMBER})
    | PARA(?P<para>[0-2O])(?P<on>[+-])
    | (?P<move>MRI|MR)(?P<move_axis>[0-2O])\s*(?P<distance>{_NUMBER})
    | (?P<go>GO)
    | WX(?P<wait>[0-2O])
    | WT\s*(?P<ms>\d+)
    | JUMP\s+(?P<jump>\w+)
    )\s*""",
    re.VERBOSE | re.IGNORECASE,
)


@dataclass(frozen=True)
class Controller:
    """Deviations of the controller: factors of speed, acceleration and clock, and delays (s)."""

    speed: float = 1.0
    acceleration: float = 1.0
    clock: float = 1.0
    delay_s: float = 0.0
    each_delay_s: float = 0.0


@dataclass(frozen=True)
class Stroke:
    """One move of one axis, from `start_m` by `displacement_m` (signed), with segments in SI."""

    axis: int
    start_s: float
    duration_s: float
    start_m: float
    displacement_m: float
    peak_m_s: float
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class Timeline:
    """All strokes in order of their start, and the duration of the program (s)."""

    strokes: tuple[Stroke, ...]
    duration_s: float


@dataclass
class _Axis:
    per_unit: Fraction = Fraction(0)
    speed: float = 0.0
    acceleration: float = 0.0
    parabolic: bool = False
    target: Fraction = Fraction(0)
    at_u: int = 0
    busy_until_s: float = 0.0
    pending: Fraction | None = None


@dataclass
class _Execution:
    controller: Controller
    until_s: float
    microstep_m: float
    now_s: float = 0.0
    axes: dict[int, _Axis] = field(default_factory=lambda: {n: _Axis() for n in _AXES})
    strokes: list[Stroke] = field(default_factory=list)

    def chosen(self, digit: str) -> list[_Axis]:
        return [self.axes[n] for n in self.numbers(digit)]

    def numbers(self, digit: str) -> list[int]:
        number = 0 if digit in "oO" else int(digit)
        return [number] if number else list(_AXES)

    def step(self, s: dict[str, str | None]) -> None:
        """Execute one statement other than a label or a jump."""
        if s["uu"]:
            for axis in self.chosen(s["uu"]):
                axis.per_unit = Fraction(int(s["steps"] or 0), int(s["per"] or 1))
        elif s["set"]:
            self._set(s["set"].upper(), s["set_axis"] or "0", float(s["value"] or 0))
        elif s["para"]:
            for axis in self.chosen(s["para"]):
                axis.parabolic = s["on"] == "+"
        elif s["move"]:
            self._target(s["move"].upper(), s["move_axis"] or "0", Fraction(s["distance"] or 0))
        elif s["go"]:
            self._start([n for n in _AXES if self.axes[n].pending is not None])
        elif s["wait"]:
            self.now_s = max([self.now_s, *(a.busy_until_s for a in self.chosen(s["wait"]))])
        elif s["ms"]:
            self.now_s += int(s["ms"]) / 1000

    def _set(self, what: str, digit: str, value: float) -> None:
        for axis in self.chosen(digit):
            if what == "VEL":
                axis.speed = value * self.controller.speed
            else:
                axis.acceleration = value * 1000 * self.controller.acceleration

    def _target(self, kind: str, digit: str, distance: Fraction) -> None:
        for number in self.numbers(digit):
            self.axes[number].pending = distance
            if kind == "MRI":
                self._start([number])

    def _start(self, numbers: list[int]) -> None:
        """Start the pending moves of these axes together; the longest one sets the profile."""
        self.now_s += self.controller.each_delay_s
        distances: dict[int, int] = {}
        for number in numbers:
            axis = self.axes[number]
            if axis.busy_until_s > self.now_s + 1e-9:
                raise ValueError(f"axis {number} is moved while it moves")
            axis.target += (axis.pending or 0) * axis.per_unit
            axis.pending = None
            distances[number] = round(axis.target) - axis.at_u
        if not any(distances.values()):
            return
        major = max(distances, key=lambda n: abs(distances[n]))
        segments = self._profile(self.axes[major], abs(distances[major]))
        for number, distance in distances.items():
            self._stroke(number, distance, abs(distances[major]), segments)

    def _profile(self, axis: _Axis, displacement_u: int) -> list[Segment]:
        unit = float(axis.per_unit)
        return profile_segments(
            displacement_u, axis.speed * unit, axis.acceleration * unit, axis.parabolic
        )

    def _stroke(
        self, number: int, displacement_u: int, major_u: int, segments: list[Segment]
    ) -> None:
        axis, rate = self.axes[number], self.controller.clock
        share = displacement_u / major_u * self.microstep_m
        scaled = tuple(
            (t / rate, v * share * rate, a * share * rate**2, j * share * rate**3)
            for t, v, a, j in segments
        )
        lasts = duration_s(segments)
        peak = max(max(v, v + a * t / 2 + j * t * t / 8, v + a * t) for t, v, a, j in segments)
        if displacement_u:
            self.strokes.append(
                Stroke(
                    number, self.now_s / rate, lasts / rate, axis.at_u * self.microstep_m,
                    displacement_u * self.microstep_m, abs(peak * share * rate), scaled,
                )
            )  # fmt: skip
        axis.at_u += displacement_u
        axis.busy_until_s = self.now_s + lasts


def statements(text: str) -> list[dict[str, str | None]]:
    """The statements of a program in order; ValueError for text that is no statement."""
    found: list[dict[str, str | None]] = []
    for number, line in enumerate(text.split("\x1a")[0].splitlines(), start=1):
        code, at = line.split(";")[0].rstrip(), 0
        while code[at:].strip():
            match = _STATEMENT.match(code, at)
            if match is None:
                raise ValueError(f"line {number}: no statement: {code[at:]!r}")
            found.append(match.groupdict())
            at = match.end()
    return found


def timeline(
    text: str,
    controller: Controller | None = None,
    until_s: float = 1e4,
    microstep_m: float = THESIS.microstep_m,
) -> Timeline:
    """The strokes of a program; an endless loop is followed up to `until_s`.

    Raises ValueError for text that is no statement and for a move of a moving axis.
    """
    listing = statements(text)
    labels = {(s["label"] or "").upper(): i for i, s in enumerate(listing) if s["label"]}
    execution = _Execution(controller or Controller(), until_s, microstep_m)
    execution.now_s = execution.controller.delay_s
    at = 0
    while at < len(listing) and execution.now_s < until_s:
        jump = listing[at]["jump"]
        execution.step(listing[at])
        at = labels[jump.upper()] if jump else at + 1
    end = max([execution.now_s, *(a.busy_until_s for a in execution.axes.values())])
    return Timeline(tuple(execution.strokes), end / execution.controller.clock)
