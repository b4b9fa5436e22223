"""Margin of each move against a stall: an energy bound where that decides, else emulated.

The moves of an axis are divided into bursts, each of which begins after the oscillation of
the one before has decayed. The motion in a burst is independent of its place and time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from mopro.lint.energy_bound import EnergyBound, Pendulum, greatest_step_m_s2
from mopro.machine import Machine
from mopro.motion import PlannedMove, Stroke
from mopro.program import AXES, ir
from mopro.source import Source, Span

# Moves in a burst; a longer one is divided.
_MOST_MOVES = 32
_LONGEST_REST_S = 1.0
_EMULATION_RATE_HZ = 50.0
_PROBES = 8
# Distinct motion that can be emulated in a few seconds; the rest is not checked.
MOST_EMULATED_S = 300.0
# Beyond this much of it the kernel is compiled for the rest; the bits are the same.
_PLAIN_S = 10.0


# Margin and slip of each motion of a burst.
Outcomes = tuple[tuple[float, bool], ...]


class MoveOnAxis(NamedTuple):
    """One axis' part of a move, in microsteps and seconds, and the rest after it."""

    length_u: int
    velocity_u_s: float
    acceleration_u_s2: float
    parabolic: bool
    rest_s: float


class LadenMachine(NamedTuple):
    """A machine with its payload, on which the motion of one axis depends."""

    machine: Machine
    payload_kg: float

    @property
    def is_nominal(self) -> bool:
        """True if the energy bound covers all forces of the machine."""
        machine = self.machine
        return machine.drive.model == "ideal" and not machine.effects and machine.forcers is None

    @property
    def pendulum(self) -> Pendulum:
        axis = self.machine.axis
        mass = axis.moving_mass_kg + self.payload_kg
        damping = axis.drive_damping_N_s_m / mass
        return Pendulum(axis.pull_out_force_N / mass, damping, axis.wave_number_1_m)


class StallMargin(NamedTuple):
    """Unused share of the pull-out force in one move of one axis, and whether the axis slips.

    Where `emulated` is false the margin is a lower bound.
    """

    move: PlannedMove
    axis: int
    burst: tuple[MoveOnAxis, ...]
    place: int
    margin: float
    slips: bool
    emulated: bool

    @property
    def motion(self) -> MoveOnAxis:
        return self.burst[self.place]


class Burst(NamedTuple):
    """Moves of one axis whose rests are too short for its oscillation to decay."""

    axis: int
    moves: tuple[PlannedMove, ...]
    motions: tuple[MoveOnAxis, ...]
    margins: tuple[float, ...]


def bursts(laden: LadenMachine, moves: Sequence[PlannedMove], axis: int) -> Iterator[Burst]:
    """The bursts of `axis`, with a lower bound on the margin of each move.

    A motion at a velocity (continuous, from the extended grammar) has no profile of its
    own and is left out.
    """
    parts = [(move, stroke) for move in moves for stroke in move.strokes if stroke.axis == axis]
    parts = [(move, stroke) for move, stroke in parts if stroke.length_u and move.profile.ramp_s]
    pendulum, microstep_m = laden.pendulum, laden.machine.microstep_m
    bound = EnergyBound(pendulum)
    held: list[tuple[PlannedMove, MoveOnAxis, float]] = []
    for index, (move, stroke) in enumerate(parts):
        following = parts[index + 1][0].start_s if index + 1 < len(parts) else move.end_s + 1e3
        motion = _move_on_axis(move, stroke, max(0.0, following - move.end_s))
        bound.largest = 0.0
        _apply(bound, move, motion, microstep_m)
        margin = _margin(bound)
        bound.rest(motion.rest_s)
        held.append((move, motion, margin))
        if bound.still or len(held) >= _MOST_MOVES or motion.rest_s > _LONGEST_REST_S:
            yield _burst(axis, held)
            held, bound = [], EnergyBound(pendulum)
    if held:
        yield _burst(axis, held)


def _burst(axis: int, held: list[tuple[PlannedMove, MoveOnAxis, float]]) -> Burst:
    moves, motions, margins = zip(*held, strict=True)
    return Burst(axis, moves, motions, margins)


def _move_on_axis(move: PlannedMove, stroke: Stroke, rest_s: float) -> MoveOnAxis:
    """The motion of one stroke; a minor axis follows the major's profile, scaled."""
    scale = abs(stroke.length_u) / move.profile.distance
    return MoveOnAxis(
        stroke.length_u,
        move.profile.velocity * scale,
        move.profile.acceleration * scale,
        move.profile.jerk != 0,
        rest_s,
    )


def _apply(bound: EnergyBound, move: PlannedMove, motion: MoveOnAxis, microstep_m: float) -> None:
    for segment in move.profile.segments(stroke=float(motion.length_u)):
        start, end = (segment.acceleration(t) for t in (segment.start_s, segment.end_s))
        bound.push(start * microstep_m, end * microstep_m, segment.end_s - segment.start_s)


def _margin(bound: EnergyBound) -> float:
    if bound.lost or bound.largest >= math.pi / 2:
        return 0.0
    return 1 - math.sin(bound.largest)


class StallMargins(NamedTuple):
    """Margins of the moves; those in `unchecked` would have taken too long to emulate."""

    laden: LadenMachine
    each: tuple[StallMargin, ...]
    unchecked: tuple[PlannedMove, ...]


def stall_margins_of(
    laden: LadenMachine, moves: Sequence[PlannedMove], enough: float
) -> StallMargins:
    """The margins of `moves`; a burst is emulated unless its bounds leave at least `enough`."""
    each: list[StallMargin] = []
    unchecked: list[PlannedMove] = []
    emulations = Emulations(laden)
    for axis in AXES:
        for burst in bursts(laden, moves, axis):
            if laden.is_nominal and min(burst.margins) >= enough:
                each += _bounded(burst)
                continue
            motion_s = sum(move.profile.duration_s for move in burst.moves)
            outcomes = emulations.of(burst.motions, motion_s)
            if outcomes is None:
                unchecked += burst.moves
            else:
                each += _emulated(burst, outcomes)
    return StallMargins(laden, tuple(each), tuple(unchecked))


def _bounded(burst: Burst) -> list[StallMargin]:
    return [
        StallMargin(move, burst.axis, burst.motions, i, margin, False, False)
        for i, (move, margin) in enumerate(zip(burst.moves, burst.margins, strict=True))
    ]


def _emulated(burst: Burst, outcomes: Outcomes) -> list[StallMargin]:
    return [
        StallMargin(move, burst.axis, burst.motions, i, margin, slips, True)
        for i, (move, (margin, slips)) in enumerate(zip(burst.moves, outcomes, strict=True))
    ]


class Emulations:
    """Emulations of bursts of one machine, each distinct one once, up to `MOST_EMULATED_S`."""

    def __init__(self, laden: LadenMachine) -> None:
        self._laden = laden
        self._asked_s = 0.0
        self._known: dict[tuple[MoveOnAxis, ...], Outcomes] = {}

    def of(self, motions: tuple[MoveOnAxis, ...], motion_s: float) -> Outcomes | None:
        """The outcomes of a burst that lasts `motion_s` (s); None once the bound is exceeded."""
        if self._asked_s > MOST_EMULATED_S:
            return None
        outcomes = self._known.get(motions)
        if outcomes is None:
            self._asked_s += motion_s
            if self._asked_s > MOST_EMULATED_S:
                return None
            compiled = True if self._asked_s > _PLAIN_S else None
            outcomes = self._known[motions] = emulated(self._laden, motions, compiled)
        return outcomes


@lru_cache(maxsize=4096)
def emulated(
    laden: LadenMachine, motions: tuple[MoveOnAxis, ...], compiled: bool | None = None
) -> Outcomes:
    """Margin and slip of each motion of a burst that starts at rest, emulated.

    `compiled` is as for `mopro.plant.simulate`.
    """
    from mopro.effects import catalogue_of
    from mopro.effects.resolve import active_effects
    from mopro.plant import plan_with_effects, simulate

    machine = laden.machine
    active = active_effects(machine, catalogue_of(machine))
    schedule = plan_with_effects(_program(motions), machine, active)
    # Without trips: the place of a burst is arbitrary, so limit switches do not apply.
    simulation = simulate(schedule, machine, active, payload_kg=laden.payload_kg, compiled=compiled)
    simulation.follow(_EMULATION_RATE_HZ)
    simulation.settle()
    outcomes = map(simulation.outcome, schedule.moves)
    return tuple((outcome.stall_margin or 0.0, outcome.slipped) for outcome in outcomes)


def _program(motions: tuple[MoveOnAxis, ...]) -> ir.Program:
    """The motions as a program for axis 1 in microsteps."""
    span, axis = Span(1, 1, 1), (1,)
    ops: list[ir.Op] = [ir.SetUnits(span, axis, 1, 1)]
    for motion in motions:
        ops += [
            ir.SetVelocity(span, axis, Fraction(motion.velocity_u_s)),
            ir.SetAcceleration(span, axis, Fraction(motion.acceleration_u_s2)),
            ir.SetProfile(span, axis, motion.parabolic),
            ir.Move(span, axis, Fraction(motion.length_u)),
            ir.WaitAxis(span, axis),
            ir.Dwell(span, round(min(motion.rest_s, _LONGEST_REST_S) * 1000)),
        ]
    return ir.Program(tuple(ops), Source("burst", ""))


def largest_acceleration(
    laden: LadenMachine, stalled: StallMargin, acceleration: float, margin: float
) -> tuple[float, float] | None:
    """Largest acceleration below `acceleration` that leaves at least `margin`, and its margin.

    In the unit of `acceleration`, to three digits; each trial is emulated. None if even a
    hundredth of `acceleration` leaves less.
    """
    shared = greatest_step_m_s2(laden.pendulum.pull_out_m_s2, margin)
    works = shared / (stalled.motion.acceleration_u_s2 * laden.machine.microstep_m) * acceleration
    works, fails = min(works, acceleration / 2), acceleration
    best: tuple[float, float] | None = None
    for _ in range(_PROBES):
        tried = _three_digits(works if best is None else (best[0] + fails) / 2)
        remaining = _margin_with(laden, stalled, tried / acceleration)
        if remaining >= margin:
            best = max(best or (0.0, 0.0), (tried, remaining))
        else:
            fails, works = tried, tried * 0.6
    return best


def _margin_with(laden: LadenMachine, stalled: StallMargin, factor: float) -> float:
    """Least margin with `factor` times the acceleration of the move and of all that share it."""
    shared = stalled.motion.acceleration_u_s2
    motions = tuple(
        motion._replace(acceleration_u_s2=shared * factor)
        if motion.acceleration_u_s2 == shared
        else motion
        for motion in stalled.burst
    )
    outcomes = emulated(laden, motions)
    return min(
        0.0 if slips else margin
        for motion, (margin, slips) in zip(stalled.burst, outcomes, strict=True)
        if motion.acceleration_u_s2 == shared
    )


def _three_digits(value: float) -> float:
    """`value` rounded down to three digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.floor(value / unit * (1 + 1e-12)) * unit:.3g}")
