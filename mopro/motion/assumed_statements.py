"""Execution of the assumed statements: continuous velocity, stop, seek, home, zero position.

Importing this registers them with `execute`.
"""

from __future__ import annotations

import math
from fractions import Fraction

from mopro.motion.planner import Planner, execute
from mopro.motion.profile import State, plan_profile
from mopro.motion.schedule import Stroke
from mopro.motion.track import AxisRegisters, brake, change_velocity
from mopro.program import ir
from mopro.source import Span


@execute.register
def _(op: ir.Continuous, planner: Planner) -> None:
    for axis in planner.of(op):
        if axis.endless or planner.ready(axis, op):
            state = _present_state(planner, axis)
            if not axis.endless:
                axis.endless_from_u = round(axis.position_u)
                axis.occupy(op.span, planner.now_s, math.inf)
            axis.track.cut(planner.now_s)
            velocity_u_s = float(op.velocity_uu_s * axis.units)
            rate = axis.acceleration_u_s2()
            axis.track.add(change_velocity(planner.now_s, state, velocity_u_s, rate))


def _present_state(planner: Planner, axis: AxisRegisters) -> State:
    if axis.endless:
        return axis.track.state(planner.now_s)
    return State(float(round(axis.position_u)), 0.0, 0.0)


@execute.register
def _(op: ir.Stop, planner: Planner) -> None:
    for axis in planner.of(op):
        if not axis.endless:
            planner.at_rest(axis, op)
            continue
        state = axis.track.state(planner.now_s)
        axis.track.cut(planner.now_s)
        segments = brake(planner.now_s, state, axis.acceleration_u_s2())
        axis.track.add(segments)
        planner.close_endless(axis, segments[-1].end_s if segments else planner.now_s)


@execute.register
def _(op: ir.Seek, planner: Planner) -> None:
    for axis in planner.of(op):
        if planner.ready(axis, op):
            _seek(planner, axis, float(op.velocity_uu_s * axis.units), op.span)


@execute.register
def _(op: ir.Home, planner: Planner) -> None:
    for axis in planner.of(op):
        if planner.ready(axis, op):
            _seek(planner, axis, -axis.velocity_u_s(), op.span)
            axis.origin_u = axis.position_u


@execute.register
def _(op: ir.ZeroPosition, planner: Planner) -> None:
    for axis in planner.of(op):
        if planner.at_rest(axis, op):
            axis.origin_u = axis.position_u


def _seek(planner: Planner, axis: AxisRegisters, velocity_u_s: float, span: Span) -> None:
    """Run to the switch, see it, and brake: a trapezoid that overruns by one ramp.

    The switch is seen on the commanded position; the real one lags by less than a tenth
    of a millimetre.
    """
    if axis.number not in planner.travel_u:
        message = f"axis {axis.number} has no limit switch to seek"
        planner.report("no-limit-switch", message, span)
        return
    low_u, high_u = planner.travel_u[axis.number]
    start_u = round(axis.position_u)
    reach_u = max(0.0, high_u - start_u if velocity_u_s > 0 else start_u - low_u)
    rate = axis.acceleration_u_s2()
    length_u = round(reach_u + min(reach_u, velocity_u_s**2 / (2 * rate)))
    end_u = start_u + int(math.copysign(length_u, velocity_u_s))
    profile = plan_profile(float(length_u), abs(velocity_u_s), rate)
    planner.record([Stroke(axis.number, start_u, end_u)], profile, span, Fraction(end_u - start_u))
    axis.position_u = Fraction(end_u)
