"""IR to schedule: a run of the program without a machine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from functools import singledispatch
from itertools import takewhile

from mopro.errors import Diagnostic, MotionError
from mopro.motion.profile import Profile, Shape, plan_profile
from mopro.motion.schedule import PlannedMove, Schedule, Stroke
from mopro.motion.track import AxisRegisters, quotient
from mopro.process.garbage import garbage_left
from mopro.program import ir
from mopro.source import Span

MOST_STATEMENTS = 5_000_000
LONGEST_RUN_S = 31 * 86400.0
# Up to here every whole number is a float.
_FARTHEST_U = 2.0**53
# Microsteps per s and per s²; a real drive loses its motor at a millionth of them.
_FASTEST_U = 1e15
# A loop is refused by its first rounds if it exceeds the limit by more than rounding may.
_CERTAINLY = 1.001

TravelU = Mapping[int, tuple[float, float]]


def plan(
    program: ir.Program, for_s: float | None = None, travel_u: TravelU | None = None
) -> Schedule:
    """The schedule of `program`, ended after `for_s` seconds if it has not ended by then.

    `travel_u` gives each axis the places of its limit switches, in microsteps from the
    start; only seeking needs them. Raises MotionError with every finding, and
    ValueError for a program that loops for ever without `for_s`.
    """
    if program.loops_forever and for_s is None:
        raise ValueError("a program that loops for ever needs a duration")
    planner = Planner(program, math.inf if for_s is None else for_s, travel_u or {})
    with garbage_left():
        planner.run()
    if planner.found:
        raise MotionError(program.source, planner.found.values())
    return planner.schedule()


class Planner:
    """Executes operations in their order and writes down what they command."""

    def __init__(self, program: ir.Program, for_s: float, travel_u: TravelU) -> None:
        self.program = program
        self.for_s = for_s
        self.travel_u = travel_u
        self.found: dict[tuple[str, Span], Diagnostic] = {}
        self.axes = {number: AxisRegisters(number) for number in ir.AXES}
        self.now_s = 0.0
        self.moves: list[PlannedMove] = []
        self._next = 0
        self._jumped_s: dict[int, float] = {}
        self._jumped_after: dict[int, int] = {}
        self._executed = 0
        self._activity: list[tuple[float, int]] = []

    def run(self) -> None:
        op: ir.Op | None = None
        while self._next < len(self.program.ops) and self.now_s < self.for_s:
            op = self.program.ops[self._next]
            self._next += 1
            self._executed += 1
            if self._executed > MOST_STATEMENTS:
                self.report_too_many(op.span, self.now_s)
                return
            self.execute(op)
        if op is not None and not self.found:
            self.finish_motions(op.span)

    def execute(self, op: ir.Op) -> None:
        execute(op, self)

    def schedule(self) -> Schedule:
        duration_s = min(self.now_s, self.for_s)
        return Schedule(
            program=self.program,
            duration_s=duration_s,
            complete=self._next >= len(self.program.ops) and self.now_s <= self.for_s,
            moves=tuple(self.moves),
            tracks={number: axis.track for number, axis in self.axes.items()},
            activity=[(t, line) for t, line in self._activity if t <= duration_s],
        )

    def report(self, rule: str, message: str, span: Span, hint: str | None = None) -> None:
        """Note a finding; a loop meets the same one again."""
        self.found.setdefault((rule, span), Diagnostic(rule, message, span, hint=hint))

    def of(self, op: ir.AxisOp) -> list[AxisRegisters]:
        return [self.axes[number] for number in op.axes]

    # -- time ------------------------------------------------------------------

    def advance(self, until_s: float, span: Span) -> None:
        """Let time pass while the program waits at `span`."""
        while self.now_s < until_s:
            moving = [axis for axis in self.axes.values() if axis.moving(self.now_s)]
            latest = max(moving, key=_by_start, default=None)
            line, pause_s = span.line, until_s
            if latest is not None:
                line, pause_s = latest.started_by.line, min(until_s, latest.busy_until_s)
            if not self._activity or self._activity[-1][1] != line:
                self._activity.append((self.now_s, line))
            self.now_s = pause_s

    def jump(self, op: ir.Jump) -> None:
        """Go on at a label, unless nothing has happened since the last time here."""
        here = self._next - 1
        before_s, before = self._jumped_s.get(here), self._jumped_after.get(here, 0)
        self._jumped_after[here] = self._executed
        if before_s == self.now_s:
            message = f"the loop from label {op.name} to this line takes no time"
            hint = "wait for a motion (`WX1`) or for a time (`WT100`) in it"
            self.report("loop-without-time", message, op.span, hint)
            self.end()
            return
        self._jumped_s[here] = self.now_s
        self._next = self.program.labels[op.name]
        if before_s is not None and not math.isinf(self.for_s):
            # The rounds of a loop are alike, so one tells how many statements there will be.
            per_s = (self._executed - before) / (self.now_s - before_s)
            if self._executed + per_s * (self.for_s - self.now_s) > _CERTAINLY * MOST_STATEMENTS:
                self.report_too_many(op.span, MOST_STATEMENTS / per_s)
                self.end()

    def report_too_many(self, span: Span, within_s: float) -> None:
        message = f"more than {MOST_STATEMENTS} statements in the time asked for"
        hint = f"ask for at most {math.floor(within_s)} s"
        self.report("too-many-statements", message, span, hint)

    def end(self) -> None:
        """Execute nothing more."""
        self._next = len(self.program.ops)

    def finish_motions(self, span: Span) -> None:
        """Let motions under way end; one without an end lasts as long as the run."""
        for axis in self.axes.values():
            if axis.endless and math.isinf(self.for_s):
                message = f"axis {axis.number} never stops, and no duration was asked for"
                self.report("endless-motion", message, axis.started_by)
                return
            if axis.endless:
                self.close_endless(axis, self.for_s)
        self.advance(max([self.now_s, *(a.busy_until_s for a in self.axes.values())]), span)

    # -- motion ----------------------------------------------------------------

    def ready(self, axis: AxisRegisters, op: ir.Op, governs: bool = True) -> bool:
        """True if `axis` may start the motion of `op` now; reports the reason if not."""
        missing = axis.missing(governs)
        for rule, what, example in missing:
            message = f"axis {axis.number} has no {what} when it is told to move"
            self.report(rule, message, op.span, f"set one above, such as `{example}`")
        return not missing and self.at_rest(axis, op)

    def at_rest(self, axis: AxisRegisters, op: ir.Op) -> bool:
        if not axis.moving(self.now_s):
            return True
        left_s = axis.busy_until_s - self.now_s
        still = "without end" if axis.endless else f"for another {left_s:.3f} s"
        starter = axis.started_by.line
        message = f"axis {axis.number} is still moving {still}: line {starter} started it"
        hint = f"put `WX{axis.number}` before line {op.span.line}"
        self.report("move-on-moving-axis", message, op.span, hint)
        return False

    def start(self, axes: list[AxisRegisters], targets_u: list[Fraction], span: Span) -> None:
        """Start `axes` together under the first one's registers.

        Each target is rounded to a microstep here, once.
        """
        major = axes[0]
        strokes = [
            Stroke(axis.number, round(axis.position_u), round(target_u))
            for axis, target_u in zip(axes, targets_u, strict=True)
        ]
        velocity, acceleration = major.velocity_u_s(), major.acceleration_u_s2()
        if not self.in_range(strokes, max(velocity, acceleration), span):
            return
        length = float(abs(strokes[0].length_u))
        profile = plan_profile(length, velocity, acceleration, major.parabolic)
        if not self.ends_in_time(profile, span):
            return
        self.record(strokes, profile, span, targets_u[0] - major.position_u)
        for axis, target_u in zip(axes, targets_u, strict=True):
            axis.position_u = target_u

    def in_range(self, strokes: list[Stroke], fastest: float, span: Span) -> bool:
        """True if targets, velocity and acceleration have numbers that can be computed with."""
        message = None
        if any(max(abs(s.start_u), abs(s.end_u)) > _FARTHEST_U for s in strokes):
            message = f"the move leads farther than {_FARTHEST_U:.5g} microsteps"
        elif fastest > _FASTEST_U:
            message = f"the move is faster than {_FASTEST_U:g} microsteps per s, or per s²"
        if message:
            hint = "check the user units, the distance, the velocity and the acceleration"
            self.report("motion-out-of-range", message, span, hint)
        return message is None

    def ends_in_time(self, profile: Profile, span: Span) -> bool:
        """True if the move takes no longer than any run may."""
        if profile.duration_s <= LONGEST_RUN_S:
            return True
        message = f"the move would last {profile.duration_s:.4g} s, more than {LONGEST_RUN_S:g} s"
        hint = "raise the velocity or the acceleration"
        self.report("motion-out-of-range", message, span, hint)
        return False

    def record(
        self, strokes: list[Stroke], profile: Profile, span: Span, distance_u: Fraction
    ) -> None:
        """Write down a move that begins now."""
        start_s = self.now_s
        units = self.axes[strokes[0].axis].units
        distance_uu = quotient(distance_u, units)
        self.moves.append(PlannedMove(span, tuple(strokes), profile, start_s, distance_uu, units))
        for stroke in strokes:
            axis = self.axes[stroke.axis]
            axis.track.add(profile.segments(start_s, float(stroke.start_u), float(stroke.length_u)))
            axis.occupy(span, start_s, start_s + profile.duration_s)

    def close_endless(self, axis: AxisRegisters, end_s: float) -> None:
        """Write a motion without end down as a move from its start to `end_s`."""
        assert axis.endless_from_u is not None, "only an endless motion can be closed"
        # From the end on, as the track may be long and the motion is its last part.
        own = takewhile(lambda s: s.end_s > axis.started_s, reversed(axis.track.segments))
        peak = max((abs(s.state(min(s.end_s, end_s)).velocity) for s in own), default=0.0)
        end_u = round(axis.track.state(end_s).position)
        stroke = Stroke(axis.number, axis.endless_from_u, end_u)
        profile = Profile(
            shape=Shape.TRAPEZOID,
            distance=float(abs(stroke.length_u)),
            velocity=peak,
            acceleration=axis.acceleration_u_s2(),
            peak_velocity=peak,
            ramp_s=0.0,
            cruise_s=end_s - axis.started_s,
        )
        distance_uu = float(stroke.length_u / axis.units)
        self.moves.append(
            PlannedMove(
                axis.started_by, (stroke,), profile, axis.started_s, distance_uu, axis.units
            )
        )
        axis.position_u = Fraction(end_u)
        axis.endless_from_u = None
        axis.busy_until_s = end_s


def _by_start(axis: AxisRegisters) -> tuple[float, Span]:
    return axis.started_s, axis.started_by


@singledispatch
def execute(op: ir.Op, planner: Planner) -> None:
    """Do what one operation commands."""
    raise TypeError(f"no motion for {type(op).__name__}")


@execute.register
def _(op: ir.SetUnits, planner: Planner) -> None:
    for axis in planner.of(op):
        axis.microsteps_per_uu = op.microsteps_per_uu


@execute.register
def _(op: ir.SetVelocity, planner: Planner) -> None:
    for axis in planner.of(op):
        axis.velocity_uu_s = op.velocity_uu_s


@execute.register
def _(op: ir.SetAcceleration, planner: Planner) -> None:
    for axis in planner.of(op):
        axis.acceleration_uu_s2 = op.acceleration_uu_s2


@execute.register
def _(op: ir.SetProfile, planner: Planner) -> None:
    for axis in planner.of(op):
        axis.parabolic = op.parabolic


@execute.register
def _(op: ir.Move, planner: Planner) -> None:
    for axis in planner.of(op):
        if planner.ready(axis, op):
            planner.start([axis], [axis.destination_u(op)], op.span)


@execute.register
def _(op: ir.SetTarget, planner: Planner) -> None:
    for axis in planner.of(op):
        if axis.microsteps_per_uu is None:
            planner.ready(axis, op, governs=False)
        else:
            axis.target_u = axis.destination_u(op)


@execute.register
def _(op: ir.Go, planner: Planner) -> None:
    targets_u = {n: axis.target_u for n, axis in planner.axes.items() if axis.target_u is not None}
    if not targets_u:
        message = "no axis has a target to go to"
        planner.report("go-without-target", message, op.span, "set one before: `MR1 8.0`")
        return
    # The longer stroke makes the major axis; of equal ones the lower number (assumed).
    order = sorted(targets_u, key=lambda n: -abs(targets_u[n] - planner.axes[n].position_u))
    axes = [planner.axes[number] for number in order]
    ready = [planner.ready(axis, op, governs=axis is axes[0]) for axis in axes]
    for axis in axes:
        axis.target_u = None
    if all(ready):
        planner.start(axes, [targets_u[number] for number in order], op.span)


@execute.register
def _(op: ir.WaitAxis, planner: Planner) -> None:
    endless = any(axis.endless for axis in planner.of(op))
    if endless and math.isinf(planner.for_s):
        message = "this wait never ends: the axis was told to move on without end"
        planner.report("endless-motion", message, op.span)
        planner.end()
    else:
        until_s = max(axis.busy_until_s for axis in planner.of(op))
        planner.advance(min(until_s, planner.for_s) if endless else until_s, op.span)


@execute.register
def _(op: ir.Dwell, planner: Planner) -> None:
    planner.advance(planner.now_s + op.milliseconds / 1000, op.span)


@execute.register
def _(op: ir.Label, planner: Planner) -> None:
    """A label is only a place."""


@execute.register
def _(op: ir.Jump, planner: Planner) -> None:
    planner.jump(op)
