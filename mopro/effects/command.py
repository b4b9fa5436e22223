"""Stage C: what a controller does with the command before the drive sees it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from mopro.effects.base import Effect, Parameter, Stage
from mopro.motion import PlannedMove, Schedule
from mopro.motion.track import Track
from mopro.program import Program, ir

_MS_PER_S = 1000


def _scaled(value: Fraction, e: float) -> Fraction:
    return value * (1 + Fraction(e))


class AccelerationScale(Effect):
    """The controller's acceleration differs from the one that the program sets.

    a' = a (1 + e); e is a ratio. Distances stay, durations follow. Source: PHYSICS.md,
    assumed; Table 4.5 gives accelerations in round numbers only.
    """

    name = "acceleration_scale"
    stage = Stage.COMMAND
    parameters = (Parameter("e", "1", "ratio", 0.05, (-0.5, 0.5), -0.9, 4.0, "relative excess"),)

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(
            replace(op, acceleration_uu_s2=_scaled(op.acceleration_uu_s2, p[0]))
            if isinstance(op, ir.SetAcceleration)
            else op
            for op in program.ops
        )
        return replace(program, ops=ops)


class VelocityScale(Effect):
    """The controller's velocity differs from the one that the program sets.

    v' = v (1 + e); e is a ratio. Distances stay, durations follow. Source: chapter 4.3,
    "the actual peak velocity is higher than the theoretical".
    """

    name = "velocity_scale"
    stage = Stage.COMMAND
    parameters = (Parameter("e", "1", "ratio", 0.01, (-0.02, 0.02), -0.5, 1.0, "relative excess"),)

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(
            replace(op, velocity_uu_s=_scaled(op.velocity_uu_s, p[0]))
            if isinstance(op, ir.SetVelocity)
            else op
            for op in program.ops
        )
        return replace(program, ops=ops)


class ProfileTick(Effect):
    """The controller works the profile out only every T seconds.

    With `interpolate` = 1 the drive goes evenly, during each tick, to where the profile
    was at the tick's beginning: x_c'(nT + τ) = x_c((n-1)T) + (x_c(nT) - x_c((n-1)T)) τ/T,
    which is late by T. With 0 it holds: x_c'(t) = x_c(T floor(t/T)), late by T/2 in the
    mean and in steps of v T. Source: assumed.
    """

    name = "profile_tick"
    stage = Stage.COMMAND
    families = ("delay",)
    parameters = (
        Parameter("T", "s", "time", 2e-3, (5e-4, 1e-2), 0.0, 0.1, "update interval"),
        Parameter(
            "interpolate", "1", "ratio", 1.0, (0, 1), 0.0, 1.0,
            "1: even motion between updates, 0: hold", null=1.0, whole=True,
        ),
    )  # fmt: skip

    def tick_s(self, *p: float) -> tuple[float, bool]:
        return p[0], bool(p[1])


class ControllerClock(Effect):
    """The controller's clock runs fast.

    x_c'(t) = x_c(t (1 + e)); e is a ratio. Motions and waits shorten alike. Source:
    assumed; crystals are within 100 ppm.
    """

    name = "controller_clock"
    stage = Stage.COMMAND
    families = ("clock",)
    parameters = (
        Parameter("e", "1", "ratio", 5e-4, (-5e-3, 5e-3), -0.1, 0.1, "relative excess of rate"),
    )

    def schedule(self, schedule: Schedule, *p: float) -> Schedule:
        rate = 1 + p[0]
        return replace(
            schedule,
            duration_s=schedule.duration_s / rate,
            moves=tuple(_faster_move(move, rate) for move in schedule.moves),
            tracks={n: _faster_track(track, rate) for n, track in schedule.tracks.items()},
            activity=[(t / rate, line) for t, line in schedule.activity],
        )


def _faster_move(move: PlannedMove, rate: float) -> PlannedMove:
    profile = replace(
        move.profile,
        velocity=move.profile.velocity * rate,
        acceleration=move.profile.acceleration * rate**2,
        peak_velocity=move.profile.peak_velocity * rate,
        ramp_s=move.profile.ramp_s / rate,
        cruise_s=move.profile.cruise_s / rate,
    )
    return replace(move, profile=profile, start_s=move.start_s / rate)


def _faster_track(track: Track, rate: float) -> Track:
    faster = Track()
    faster.add(
        replace(
            s,
            start_s=s.start_s / rate,
            end_s=s.end_s / rate,
            anchor_s=s.anchor_s / rate,
            v=s.v * rate,
            a=s.a * rate**2,
            j=s.j * rate**3,
        )
        for s in track.segments
    )
    return faster


class StartDelay(Effect):
    """Motion starts later than it is told to.

    x_c'(t) = x_c(t - d), d in s, once at the start of the program; with `every_move` = 1
    each move is late by d, which adds up where the program waits for motions to end.
    Source: assumed.
    """

    name = "start_delay"
    stage = Stage.COMMAND
    families = ("delay",)
    parameters = (
        Parameter("d", "s", "time", 5e-3, (0.0, 0.02), 0.0, 10.0, "delay"),
        Parameter(
            "every_move", "1", "ratio", 0.0, (0, 1), 0.0, 1.0,
            "0: once, 1: before each move", whole=True,
        ),
    )  # fmt: skip

    def program(self, program: Program, *p: float) -> Program:
        milliseconds = Fraction(p[0]) * _MS_PER_S
        if not p[1]:
            return replace(program, ops=(ir.Dwell(program.ops[0].span, milliseconds), *program.ops))
        ops: list[ir.Op] = []
        for op in program.ops:
            if op.seeks_switch or isinstance(op, ir.Move | ir.Go):
                ops.append(ir.Dwell(op.span, milliseconds))
            ops.append(op)
        return replace(program, ops=tuple(ops))


class LostSteps(Effect):
    """The axis falls whole pitches behind, as after a stall, and stays there.

    x := x - n p at the share `at` of the axis' move number `move`; n counts pitches.
    The force has period p, so nothing else changes. Source: chapter 4.4, "the motor
    would simply stall"; the figures are assumed.
    """

    name = "lost_steps"
    stage = Stage.COMMAND
    parameters = (
        Parameter("n", "1", "ratio", 1.0, (-50, 50), -1000.0, 1000.0, "pitches lost", whole=True),
        Parameter(
            "move", "1", "ratio", 1.0, (1, 100), 1.0, 1e9,
            "in which of the axis' moves", null=1.0, whole=True,
        ),
        Parameter("at", "1", "ratio", 0.5, (0.0, 1.0), 0.0, 1.0, "share of that move", null=0.5),
    )  # fmt: skip

    def jumps(self, moves: list[PlannedMove], *p: float) -> list[tuple[float, float]]:
        index = int(p[1]) - 1
        if index >= len(moves):
            return []
        move = moves[index]
        return [(move.start_s + p[2] * move.profile.duration_s, p[0])]
