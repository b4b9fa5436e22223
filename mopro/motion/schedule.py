"""IR to a timed command: when each axis is told to be where.

A run of the program without a machine. The controller is open loop and knows only
microsteps, and so does the schedule; positions are exact rationals that are rounded to
a microstep once for each target, so nothing drifts. Times are in seconds, `_u` in
microsteps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import singledispatchmethod

from mopro.errors import Diagnostic, MotionError
from mopro.motion.profile import Profile, Shape, State, plan_profile
from mopro.motion.track import Track, brake, change_velocity
from mopro.program import ir
from mopro.source import Span

# A motion this close to its end has ended: far below one sample, far above rounding.
_TIME_TOLERANCE_S = 1e-9
MOST_STATEMENTS = 5_000_000


@dataclass(frozen=True, slots=True)
class Stroke:
    """What one axis covers in one move, between whole microsteps."""

    axis: int
    start_u: int
    end_u: int

    @property
    def length_u(self) -> int:
        return self.end_u - self.start_u


@dataclass(frozen=True, slots=True)
class PlannedMove:
    """One started motion; the first stroke is the major axis, whose profile governs.

    `distance_uu` is how far the program sends the major axis; its stroke is that rounded
    to whole microsteps.
    """

    span: Span
    strokes: tuple[Stroke, ...]
    profile: Profile
    start_s: float
    distance_uu: float
    microsteps_per_uu: Fraction

    @property
    def end_s(self) -> float:
        return self.start_s + self.profile.duration_s

    @property
    def axes(self) -> tuple[int, ...]:
        return tuple(stroke.axis for stroke in self.strokes)

    def in_uu(self, microsteps: float) -> float:
        """A length, velocity or acceleration in user units."""
        return microsteps * self.microsteps_per_uu.denominator / self.microsteps_per_uu.numerator


@dataclass(frozen=True)
class Schedule:
    """The timed command of a whole run.

    `activity` are the times from which a source line is the running one: the line that
    started the motion under way (the latest if there are several), or else the
    statement that the program waits at.
    """

    program: ir.Program
    duration_s: float
    complete: bool
    moves: tuple[PlannedMove, ...]
    tracks: Mapping[int, Track]
    activity: Sequence[tuple[float, int]]

    def final_u(self, axis: int) -> int:
        """Where the command leaves `axis`, in microsteps from the start."""
        return round(self.tracks[axis].state(self.duration_s).position)


def plan(
    program: ir.Program,
    for_s: float | None = None,
    travel_u: Mapping[int, tuple[float, float]] | None = None,
) -> Schedule:
    """The schedule of `program`, ended after `for_s` seconds if it has not ended by then.

    `travel_u` gives each axis the places of its limit switches, in microsteps from the
    start; only seeking needs them. Raises MotionError with every finding, and
    ValueError for a program that loops for ever without `for_s`.
    """
    if program.loops_forever and for_s is None:
        raise ValueError("a program that loops for ever needs a duration")
    planner = _Planner(program, math.inf if for_s is None else for_s, travel_u or {})
    planner.run()
    if planner.found:
        raise MotionError(program.source, planner.found.values())
    return planner.schedule()


@dataclass
class _Axis:
    """The controller's registers of one axis, and the motion that it is in."""

    number: int
    microsteps_per_uu: Fraction | None = None
    velocity_uu_s: Fraction | None = None
    acceleration_uu_s2: Fraction | None = None
    parabolic: bool = False
    position_u: Fraction = Fraction(0)
    origin_u: Fraction = Fraction(0)
    target_u: Fraction | None = None
    target_span: Span | None = None
    track: Track = field(default_factory=Track)
    busy_until_s: float = -math.inf
    started_s: float = 0.0
    started_by: Span = field(default_factory=lambda: Span(1, 1, 1))
    endless_from_u: int | None = None

    @property
    def endless(self) -> bool:
        return self.endless_from_u is not None

    def moving(self, t: float) -> bool:
        return self.busy_until_s > t + _TIME_TOLERANCE_S

    def occupy(self, span: Span, start_s: float, end_s: float) -> None:
        self.started_by, self.started_s, self.busy_until_s = span, start_s, end_s

    def destination_u(self, op: ir.Move | ir.SetTarget) -> Fraction:
        way_u = op.distance_uu * self.units
        return (self.origin_u if op.absolute else self.position_u) + way_u

    @property
    def units(self) -> Fraction:
        assert self.microsteps_per_uu is not None, "checked before each move"
        return self.microsteps_per_uu

    def velocity_u_s(self) -> float:
        assert self.velocity_uu_s is not None, "checked before each move"
        return float(self.velocity_uu_s * self.units)

    def acceleration_u_s2(self) -> float:
        assert self.acceleration_uu_s2 is not None, "checked before each move"
        return float(self.acceleration_uu_s2 * self.units)


class _Planner:
    """Executes the operations and writes down what they command."""

    def __init__(
        self, program: ir.Program, for_s: float, travel_u: Mapping[int, tuple[float, float]]
    ) -> None:
        self.found: dict[tuple[str, Span], Diagnostic] = {}
        self._program = program
        self._for_s = for_s
        self._travel_u = travel_u
        self._axes = {number: _Axis(number) for number in ir.AXES}
        self._now_s = 0.0
        self._next = 0
        self._jumped_s: dict[int, float] = {}
        self._moves: list[PlannedMove] = []
        self._activity: list[tuple[float, int]] = []

    # -- the run ---------------------------------------------------------------

    def run(self) -> None:
        executed = 0
        op: ir.Op | None = None
        while self._next < len(self._program.ops) and self._now_s < self._for_s:
            op = self._program.ops[self._next]
            self._next += 1
            executed += 1
            if executed > MOST_STATEMENTS:
                message = f"more than {MOST_STATEMENTS} statements in {self._now_s:.3f} s"
                self._report("too-many-statements", message, op.span, "ask for a shorter time")
                return
            self._execute(op)
        if op is not None and not self.found:
            self._finish_motions(op.span)

    def schedule(self) -> Schedule:
        duration_s = min(self._now_s, self._for_s)
        return Schedule(
            program=self._program,
            duration_s=duration_s,
            complete=self._next >= len(self._program.ops) and self._now_s <= self._for_s,
            moves=tuple(self._moves),
            tracks={number: axis.track for number, axis in self._axes.items()},
            activity=[(t, line) for t, line in self._activity if t <= duration_s],
        )

    def _finish_motions(self, span: Span) -> None:
        """Let motions under way end; one without an end lasts as long as the run."""
        for axis in self._axes.values():
            if axis.endless:
                if math.isinf(self._for_s):
                    message = f"axis {axis.number} never stops, and no duration was asked for"
                    self._report("endless-motion", message, axis.started_by)
                    return
                self._close_endless(axis, self._for_s)
        self._advance(max([self._now_s, *(a.busy_until_s for a in self._axes.values())]), span)

    def _advance(self, until_s: float, span: Span) -> None:
        """Let time pass while the program waits at `span`."""
        while self._now_s < until_s:
            moving = [axis for axis in self._axes.values() if axis.moving(self._now_s)]
            latest = max(moving, key=lambda a: (a.started_s, a.started_by), default=None)
            line, pause_s = span.line, until_s
            if latest is not None:
                line, pause_s = latest.started_by.line, min(until_s, latest.busy_until_s)
            if not self._activity or self._activity[-1][1] != line:
                self._activity.append((self._now_s, line))
            self._now_s = pause_s

    def _report(self, rule: str, message: str, span: Span, hint: str | None = None) -> None:
        self.found.setdefault((rule, span), Diagnostic(rule, message, span, hint=hint))

    # -- checks ----------------------------------------------------------------

    def _ready(self, axis: _Axis, op: ir.Op, governs: bool = True) -> bool:
        """Whether `axis` may start the motion of `op` now; reports why not.

        An axis that follows another's profile needs no velocity of its own.
        """
        missing = []
        if axis.microsteps_per_uu is None:
            missing.append(("missing-units", "user units", f"UU{axis.number}12500/1"))
        if governs and axis.velocity_uu_s is None:
            missing.append(("missing-velocity", "velocity", f"VEL{axis.number} 40.0"))
        if governs and axis.acceleration_uu_s2 is None:
            missing.append(("missing-acceleration", "acceleration", f"ACC{axis.number} 0.25"))
        for rule, what, example in missing:
            message = f"axis {axis.number} has no {what} when it is told to move"
            self._report(rule, message, op.span, f"set one above, such as `{example}`")
        return not missing and self._at_rest(axis, op)

    def _at_rest(self, axis: _Axis, op: ir.Op) -> bool:
        if not axis.moving(self._now_s):
            return True
        left_s = axis.busy_until_s - self._now_s
        still = "without end" if axis.endless else f"for another {left_s:.3f} s"
        message = (
            f"axis {axis.number} is still moving {still}: line {axis.started_by.line} started it"
        )
        hint = f"put `WX{axis.number}` before line {op.span.line}"
        self._report("move-on-moving-axis", message, op.span, hint)
        return False

    # -- operations ------------------------------------------------------------

    @singledispatchmethod
    def _execute(self, op: ir.Op) -> None:
        raise TypeError(f"no motion for {type(op).__name__}")

    def _of(self, op: ir.AxisOp) -> list[_Axis]:
        return [self._axes[number] for number in op.axes]

    @_execute.register
    def _(self, op: ir.SetUnits) -> None:
        for axis in self._of(op):
            axis.microsteps_per_uu = op.microsteps_per_uu

    @_execute.register
    def _(self, op: ir.SetVelocity) -> None:
        for axis in self._of(op):
            axis.velocity_uu_s = op.velocity_uu_s

    @_execute.register
    def _(self, op: ir.SetAcceleration) -> None:
        for axis in self._of(op):
            axis.acceleration_uu_s2 = op.acceleration_uu_s2

    @_execute.register
    def _(self, op: ir.SetProfile) -> None:
        for axis in self._of(op):
            axis.parabolic = op.parabolic

    @_execute.register
    def _(self, op: ir.Move) -> None:
        for axis in self._of(op):
            if self._ready(axis, op):
                self._start([axis], [axis.destination_u(op)], op.span)

    @_execute.register
    def _(self, op: ir.SetTarget) -> None:
        for axis in self._of(op):
            if self._ready_for_target(axis, op):
                axis.target_u, axis.target_span = axis.destination_u(op), op.span

    def _ready_for_target(self, axis: _Axis, op: ir.SetTarget) -> bool:
        if axis.microsteps_per_uu is None:
            self._ready(axis, op, governs=False)
            return False
        return True

    @_execute.register
    def _(self, op: ir.Go) -> None:
        axes = [axis for axis in self._axes.values() if axis.target_u is not None]
        if not axes:
            message = "no axis has a target to go to"
            self._report("go-without-target", message, op.span, "set one before: `MR1 8.0`")
            return
        # The longer way makes the major axis; of equal ways the lower number (assumed).
        axes.sort(key=lambda a: -abs(_target_u(a) - a.position_u))
        targets = [_target_u(axis) for axis in axes]
        ready = [self._ready(axis, op, governs=axis is axes[0]) for axis in axes]
        for axis in axes:
            axis.target_u = None
        if all(ready):
            self._start(axes, targets, op.span)

    def _start(self, axes: list[_Axis], targets_u: list[Fraction], span: Span) -> None:
        """Start `axes` together under the first one's registers."""
        major = axes[0]
        strokes = [
            Stroke(axis.number, round(axis.position_u), round(target_u))
            for axis, target_u in zip(axes, targets_u, strict=True)
        ]
        profile = plan_profile(
            float(abs(strokes[0].length_u)),
            major.velocity_u_s(),
            major.acceleration_u_s2(),
            major.parabolic,
        )
        self._record(strokes, profile, span, targets_u[0] - major.position_u)
        for axis, target_u in zip(axes, targets_u, strict=True):
            axis.position_u = target_u

    def _record(
        self, strokes: list[Stroke], profile: Profile, span: Span, distance_u: Fraction
    ) -> None:
        start_s = self._now_s
        units = self._axes[strokes[0].axis].units
        distance_uu = float(distance_u / units)
        self._moves.append(PlannedMove(span, tuple(strokes), profile, start_s, distance_uu, units))
        for stroke in strokes:
            axis = self._axes[stroke.axis]
            axis.track.add(profile.segments(start_s, float(stroke.start_u), float(stroke.length_u)))
            axis.occupy(span, start_s, start_s + profile.duration_s)

    @_execute.register
    def _(self, op: ir.WaitAxis) -> None:
        until_s = max(axis.busy_until_s for axis in self._of(op))
        if math.isinf(until_s) and until_s > 0:
            if math.isinf(self._for_s):
                message = "this wait never ends: the axis was told to move on without end"
                self._report("endless-motion", message, op.span)
                self._next = len(self._program.ops)
                return
            until_s = self._for_s
        self._advance(until_s, op.span)

    @_execute.register
    def _(self, op: ir.Dwell) -> None:
        self._advance(self._now_s + op.milliseconds / 1000, op.span)

    @_execute.register
    def _(self, op: ir.Label) -> None:
        return

    @_execute.register
    def _(self, op: ir.Jump) -> None:
        here = self._next - 1
        if self._jumped_s.get(here) == self._now_s:
            message = f"the loop from label {op.name} to this line takes no time"
            hint = "wait for a motion (`WX1`) or for a time (`WT100`) in it"
            self._report("loop-without-time", message, op.span, hint)
            self._next = len(self._program.ops)
            return
        self._jumped_s[here] = self._now_s
        self._next = self._program.labels[op.name]

    # -- assumed statements ----------------------------------------------------

    @_execute.register
    def _(self, op: ir.Continuous) -> None:
        for axis in self._of(op):
            if not axis.endless and not self._ready(axis, op):
                continue
            state = axis.track.state(self._now_s)
            if not axis.endless:
                axis.endless_from_u = round(axis.position_u)
                axis.occupy(op.span, self._now_s, math.inf)
                state = State(float(axis.endless_from_u), 0.0, 0.0)
            axis.track.cut(self._now_s)
            velocity = float(op.velocity_uu_s * axis.units)
            rate = axis.acceleration_u_s2()
            axis.track.add(change_velocity(self._now_s, state, velocity, rate))

    @_execute.register
    def _(self, op: ir.Stop) -> None:
        for axis in self._of(op):
            if axis.endless:
                state = axis.track.state(self._now_s)
                axis.track.cut(self._now_s)
                segments, target_u = brake(self._now_s, state, axis.acceleration_u_s2())
                axis.track.add(segments)
                end_s = segments[-1].end_s if segments else self._now_s
                self._close_endless(axis, end_s, target_u)
            else:
                self._at_rest(axis, op)

    def _close_endless(self, axis: _Axis, end_s: float, target_u: int | None = None) -> None:
        """Write an endless motion down as a move from its start to `end_s`."""
        assert axis.endless_from_u is not None, "only for an endless motion"
        if target_u is None:
            target_u = round(axis.track.state(end_s).position)
        stroke = Stroke(axis.number, axis.endless_from_u, target_u)
        peak = max(
            (
                abs(s.state(s.end_s).velocity)
                for s in axis.track.segments
                if s.start_s >= axis.started_s and not math.isinf(s.end_s)
            ),
            default=0.0,
        )
        duration_s = end_s - axis.started_s
        rate = axis.acceleration_u_s2()
        profile = Profile(
            Shape.TRAPEZOID, float(abs(stroke.length_u)), peak, rate, peak, 0.0, duration_s
        )
        self._moves.append(
            PlannedMove(
                axis.started_by,
                (stroke,),
                profile,
                axis.started_s,
                float(stroke.length_u / axis.units),
                axis.units,
            )
        )
        axis.position_u = Fraction(target_u)
        axis.endless_from_u = None
        axis.busy_until_s = end_s

    @_execute.register
    def _(self, op: ir.Seek) -> None:
        for axis in self._of(op):
            if self._ready(axis, op):
                self._seek(axis, float(op.velocity_uu_s * axis.units), op.span)

    @_execute.register
    def _(self, op: ir.Home) -> None:
        for axis in self._of(op):
            if self._ready(axis, op):
                self._seek(axis, -axis.velocity_u_s(), op.span)
                axis.origin_u = axis.position_u

    def _seek(self, axis: _Axis, velocity_u_s: float, span: Span) -> None:
        """Run to the switch, see it, and brake: a trapezoid that overruns by one ramp.

        The switch is seen on the commanded position; the real one lags by less than a
        tenth of a millimetre.
        """
        if axis.number not in self._travel_u:
            message = f"axis {axis.number} has no limit switch to seek"
            self._report("no-limit-switch", message, span)
            return
        low_u, high_u = self._travel_u[axis.number]
        start_u = round(axis.position_u)
        way_u = max(0.0, high_u - start_u if velocity_u_s > 0 else start_u - low_u)
        rate = axis.acceleration_u_s2()
        ramp_u = velocity_u_s**2 / (2 * rate)
        length_u = round(way_u + min(way_u, ramp_u))
        stroke = Stroke(axis.number, start_u, start_u + int(math.copysign(length_u, velocity_u_s)))
        profile = plan_profile(float(length_u), abs(velocity_u_s), rate)
        self._record([stroke], profile, span, Fraction(stroke.length_u))
        axis.position_u = Fraction(stroke.end_u)


def _target_u(axis: _Axis) -> Fraction:
    assert axis.target_u is not None, "only axes with a target go"
    return axis.target_u
