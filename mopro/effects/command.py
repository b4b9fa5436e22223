"""Effects on the controller's command, before the drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from mopro.effects.effect import Domain, Effect, Parameter, View
from mopro.effects.starts import Values, delay_s, residual_m, step
from mopro.engine.candidate import RUN, Candidate, FindStarts, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.motion import PlannedMove, Schedule
from mopro.motion.track import Track
from mopro.program import Program, ir


class ScaledSetting(Effect):
    """Base of effects whose parameter e (a ratio) makes a setting s of programs s (1 + e).

    `operation` is the operation that sets it, `setting` the field that holds it.
    """

    domain = Domain.COMMAND
    operation: ClassVar[type[ir.Op]]
    setting: ClassVar[str]

    def program(self, program: Program, *p: float) -> Program:
        ops = tuple(self._scaled(op, p[0]) for op in program.ops)
        return replace(program, ops=ops)

    def _scaled(self, op: ir.Op, e: float) -> ir.Op:
        if not isinstance(op, self.operation):
            return op
        changed: dict[str, Any] = {self.setting: getattr(op, self.setting) * (1 + Fraction(e))}
        return replace(op, **changed)

    def fastest(self) -> tuple[float, ...]:
        return (self.parameter("e").plausible[1],)


class ControllerClock(Effect):
    """The controller's clock runs fast.

    x_c'(t) = x_c(t (1 + e)); e is a ratio. Motions and waits shorten alike. Source:
    assumed; crystals are within 100 ppm.
    """

    name = "controller_clock"
    domain = Domain.COMMAND
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

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 3e-4))


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


# Least delay that may be a tick, in its standard errors.
_DELAY_SIGMAS = 5.0
# Size of the grid's sags in σ from which the tick is refined: only close values then keep
# the phase of the grid over the whole run.
_GRID_SIGMAS = 2.0
# Most ticks that are tried, and the least step of their number in a run: at its end the grid is off
# by a tenth of a tick at the most, from where a fit finds the rest. Halved, twice as many are
# simulated; doubled, a fifth of a tick is left.
_TICKS_TRIED = 21
_STEP = 0.2
# Four fifths of the shortest plausible tick, and more than the longest: what is farther outside is
# clearly implausible, and neither an answer nor an alternative.
_SHORTEST_S, _LONGEST_S = 2e-4, 0.015
_TICK = Fitted(
    "T", "s", _SHORTEST_S, _LONGEST_S, role=Role.SHAPE, plausible=(2.5e-4, 0.0125), difference=1e-6
)


class ProfileTick(Effect):
    """The controller computes the profile only every T seconds.

    With `interpolate` = 1 the drive moves at constant speed, during each tick, to the
    position of the profile at the tick's beginning:
    x_c'(nT + τ) = x_c((n-1)T) + (x_c(nT) - x_c((n-1)T)) τ/T, which is late by T. With 0 it
    holds: x_c'(t) = x_c(T floor(t/T)), late by T/2 on average, in steps of v T.
    Source: assumed.
    """

    name = "profile_tick"
    domain = Domain.COMMAND
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

    def forms(self, view: View) -> Iterator[Candidate]:
        """Interpolated motion is late by one tick, held motion by half a tick."""
        for form, interpolate, ticks in (("interpolated", 1.0, 1.0), ("held", 0.0, 2.0)):
            fixed = {"interpolate": interpolate}
            yield self.form(
                _TICK, form=form, fixed=fixed, find_starts=self._search(view, ticks, fixed)
            )

    def _search(self, view: View, ticks: float, fixed: Values) -> FindStarts:
        """Search for the tick as `ticks` times the delay of the data.

        Where the grid of the tick is visible, the best value near it is taken.
        """

        def find_tick(fit: ResidualView) -> Iterator[Values]:
            late_s, error_s = delay_s(view, fit)
            tick_s = ticks * late_s
            if not (late_s > _DELAY_SIGMAS * error_s and _SHORTEST_S < tick_s < _LONGEST_S):
                return
            if _grid_sigmas(view, fit, tick_s) < _GRID_SIGMAS:
                yield {"T": tick_s}
                return
            # Beside any effects a tick changes what it changes alone, to within what they do to it.
            left = np.concatenate(fit.residuals)
            trials = _around(view, tick_s, ticks * 2 * error_s)
            changed = (left + fit.alone({self.name: {"T": t, **fixed}}) for t in trials)
            yield {"T": trials[int(np.argmin([float(own @ own) for own in changed]))]}

        return find_tick


def _around(view: View, tick_s: float, error_s: float) -> list[float]:
    """Ticks within `error_s`, or within the change that shifts the grid by one tick at the end.

    Their numbers in the longest run are multiples of one step, so that ticks which were tried
    before are tried again: a fifth, or that doubled until there are few enough.
    """
    last_s = max(float(reading.time_s[-1]) for _, reading in view.positions().values())
    number = last_s / tick_s
    reach = number * max(error_s / tick_s, 1 / number)
    step = _STEP * 2 ** max(math.ceil(math.log2(2 * reach / (_TICKS_TRIED * _STEP))), 0)
    first, last = math.ceil((number - reach) / step), math.floor((number + reach) / step)
    shared = (last_s / (step * n) for n in range(max(first, 1), last + 1))
    trials = (*shared, *_round_numbers(tick_s))
    return [t for t in trials if _SHORTEST_S < t < _LONGEST_S]


def _round_numbers(tick_s: float) -> set[float]:
    """Round numbers within 1 % of `tick_s`."""
    grids = (1e-4, 2.5e-4, 5e-4, 1e-3)
    near = {round(tick_s / grid) * grid for grid in grids}
    return {t for t in near if abs(t - tick_s) < 0.01 * tick_s}


def _grid_sigmas(view: View, fit: ResidualView, tick_s: float) -> float:
    """Norm, in σ, of the sags between the interpolated command and the profile.

    The mean sag of a chord over T is a T²/12.
    """
    sags = [
        np.asarray(fit.data[row].labels["acceleration"], dtype=float) * tick_s**2 / 12
        / fit.sigmas[row]
        for row in view.positions()
    ]  # fmt: skip
    return math.sqrt(sum(float(sag @ sag) for sag in sags))


class AccelerationScale(ScaledSetting):
    """The controller's acceleration differs from the one that the program sets.

    a' = a (1 + e); e is a ratio. Distances stay, durations follow. Source: assumed;
    Table 4.5 gives accelerations in round numbers only.
    """

    name = "acceleration_scale"
    operation = ir.SetAcceleration
    setting = "acceleration_uu_s2"
    parameters = (Parameter("e", "1", "ratio", 0.05, (-0.5, 0.5), -0.9, 4.0, "relative excess"),)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 0.02, -0.1, 0.1, -0.35, 0.4))


class VelocityScale(ScaledSetting):
    """The controller's velocity differs from the one that the program sets.

    v' = v (1 + e); e is a ratio. Distances stay, durations follow. Source: chapter 4.3,
    "the actual peak velocity is higher than the theoretical".
    """

    name = "velocity_scale"
    operation = ir.SetVelocity
    setting = "velocity_uu_s"
    parameters = (Parameter("e", "1", "ratio", 0.01, (-0.02, 0.02), -0.5, 1.0, "relative excess"),)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 1e-3, -0.01, 0.015))


_MS_PER_S = 1000


class StartDelay(Effect):
    """Motion starts later than commanded.

    x_c'(t) = x_c(t - d), d in s, once at the start of the program; with `every_move` = 1
    each move is late by d, which adds up where the program waits for motions to end.
    Source: assumed.
    """

    name = "start_delay"
    domain = Domain.COMMAND
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

    def forms(self, view: View) -> Iterator[Candidate]:
        delay = self.fitted("d", 1e-3, 8e-3)
        yield self.form(delay, form="once", fixed={"every_move": 0.0})
        yield self.form(delay, form="each move", fixed={"every_move": 1.0})


# Largest difference from a whole number of pitches, in pitches or as a share of the step.
_WHOLE_TOLERANCE = 0.25


class LostSteps(Effect):
    """The axis falls whole pitches behind, as after a stall, and stays there.

    x := x - n p at the share `at` of the axis' move number `move`; n counts pitches.
    The force has period p, so nothing else changes. Source: chapter 4.4, "the motor
    would simply stall"; the figures are assumed.
    """

    name = "lost_steps"
    domain = Domain.COMMAND
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

    def forms(self, view: View) -> Iterator[Candidate]:
        """None for a logged command, which has no moves to count."""
        if any(run.program is None for run in view.runs):
            return
        numbers = (
            Fitted(name, "1", -1e9, 1e9, role=Role.SEARCHED) for name in ("n", "move", "at", RUN)
        )
        yield self.form(*numbers, flexible=True, find_starts=lambda fit: _steps(view, fit))


def _steps(view: View, fit: ResidualView) -> Iterator[Values]:
    """Starting values for lasting steps of whole pitches, in one run or in the same move of all.

    A run of fewer moves has no such move, and shows none.
    """
    steps: list[dict[str, float]] = []
    counts: list[int] = []
    begun, over = 0.0, 1.0
    for row, (run, reading) in view.positions().items():
        here = step(fit.residuals[row], residual_m(view, fit, row), reading.time_s)
        moves = [m for m in view.schedule(run).moves if reading.sensor.axis in m.axes]
        counts.append(len(moves))
        if here is None or not moves:
            continue
        before_s, after_s, height_m = here
        pitches = _whole_pitches(-height_m / view.machine.axis.pitch_m)
        if not pitches:
            continue
        index, share = _place(moves, (before_s + after_s) / 2)
        steps.append({"n": float(pitches), "move": index + 1.0, "at": share, RUN: float(run)})
        begun = max(begun, _share(moves[index], before_s))
        over = min(over, _share(moves[index], after_s))
    yield from steps
    alike = {(f["n"], f["move"]) for f in steps}
    able = sum(count >= own["move"] for own in steps[:1] for count in counts)
    if len(steps) > 1 and len(steps) == able and len(alike) == 1:
        # Each run bounds the time by two samples; their intersection is the narrowest.
        yield {**steps[0], "at": (begun + over) / 2, RUN: -1.0}


def _whole_pitches(pitches: float) -> int:
    """The whole number that `pitches` is close to, else 0."""
    whole = round(pitches)
    return whole if abs(pitches - whole) <= _WHOLE_TOLERANCE * max(1, abs(whole)) else 0


def _place(moves: Sequence[PlannedMove], time_s: float) -> tuple[int, float]:
    """Index of the move at `time_s`, and the share of its duration that has passed."""
    begun = [i for i, move in enumerate(moves) if move.start_s <= time_s]
    index = begun[-1] if begun else 0
    return index, _share(moves[index], time_s)


def _share(move: PlannedMove, time_s: float) -> float:
    """Share of the move's duration that has passed at `time_s`, 0 to 1."""
    return min(max((time_s - move.start_s) / move.profile.duration_s, 0.0), 1.0)
