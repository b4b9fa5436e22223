"""What each move asks of the motor: bounded where a bound decides, else emulated.

The moves of an axis fall into bursts, each of which begins when the swing of the one
before has died down; what happens in a burst does not depend on where it is or when.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from mopro.lint.swing import Swing, Swinger, greatest_step_m_s2
from mopro.machine import Machine
from mopro.motion import PlannedMove, Stroke
from mopro.program import AXES, ir
from mopro.source import Source, Span

# A burst without end is looked at in pieces of this many moves.
_MOST_MOVES = 32
_LONGEST_REST_S = 1.0
_EMULATION_RATE_HZ = 50.0
# Where a burst is does not matter here, so that it shall meet no limit switch.
_ENDLESS_M = 1e6
_PROBES = 8
# As much motion, all different, is emulated in a few seconds; a run shows the rest.
MOST_EMULATED_S = 300.0


class Leg(NamedTuple):
    """One axis' part of a move, in microsteps and seconds, and the rest after it."""

    length_u: int
    velocity_u_s: float
    acceleration_u_s2: float
    parabolic: bool
    rest_s: float


class Plant(NamedTuple):
    """What the motion of one axis depends on."""

    machine: Machine
    payload_kg: float

    @property
    def is_nominal(self) -> bool:
        """Whether the bound knows all that moves the axis."""
        machine = self.machine
        return machine.drive.model == "ideal" and not machine.effects and machine.forcers is None

    @property
    def swinger(self) -> Swinger:
        axis = self.machine.axis
        mass = axis.moving_mass_kg + self.payload_kg
        damping = axis.drive_damping_N_s_m / mass
        return Swinger(axis.pull_out_force_N / mass, damping, axis.wave_number_1_m)


class Stress(NamedTuple):
    """What one move of one axis asks: the share of the pull-out force left, and whether it slips.

    Where `emulated` is false the margin is a lower bound.
    """

    move: PlannedMove
    axis: int
    burst: tuple[Leg, ...]
    place: int
    margin: float
    slips: bool
    emulated: bool

    @property
    def leg(self) -> Leg:
        return self.burst[self.place]


class Burst(NamedTuple):
    """Moves of one axis with no rest between them that is long enough to stop its swing."""

    axis: int
    moves: tuple[PlannedMove, ...]
    legs: tuple[Leg, ...]
    margins: tuple[float, ...]


def bursts(plant: Plant, moves: Sequence[PlannedMove], axis: int) -> Iterator[Burst]:
    """The bursts of `axis`, each move with its bound of the margin.

    A motion at a velocity (continuous, from the extended grammar) has no profile of its
    own and is left out.
    """
    parts = [(move, stroke) for move in moves for stroke in move.strokes if stroke.axis == axis]
    parts = [(move, stroke) for move, stroke in parts if stroke.length_u and move.profile.ramp_s]
    swing = Swing(plant.swinger)
    held: list[tuple[PlannedMove, Leg, float]] = []
    for index, (move, stroke) in enumerate(parts):
        following = parts[index + 1][0].start_s if index + 1 < len(parts) else move.end_s + 1e3
        leg = _leg(move, stroke, max(0.0, following - move.end_s))
        swing.largest = 0.0
        _live_through(swing, move, leg, plant.machine.microstep_m)
        margin = _margin(swing)
        swing.push(0.0, 0.0, leg.rest_s)
        held.append((move, leg, margin))
        if swing.still or len(held) >= _MOST_MOVES or leg.rest_s > _LONGEST_REST_S:
            yield _burst(axis, held)
            held, swing = [], Swing(plant.swinger)
    if held:
        yield _burst(axis, held)


def _burst(axis: int, held: list[tuple[PlannedMove, Leg, float]]) -> Burst:
    moves, legs, margins = zip(*held, strict=True)
    return Burst(axis, moves, legs, margins)


def _leg(move: PlannedMove, stroke: Stroke, rest_s: float) -> Leg:
    """A minor axis runs the major's profile, scaled."""
    scale = abs(stroke.length_u) / move.profile.distance
    return Leg(
        stroke.length_u,
        move.profile.velocity * scale,
        move.profile.acceleration * scale,
        move.profile.jerk != 0,
        rest_s,
    )


def _live_through(swing: Swing, move: PlannedMove, leg: Leg, microstep_m: float) -> None:
    for segment in move.profile.segments(stroke=float(leg.length_u)):
        start, end = (segment.state(t).acceleration for t in (segment.start_s, segment.end_s))
        swing.push(start * microstep_m, end * microstep_m, segment.end_s - segment.start_s)


def _margin(swing: Swing) -> float:
    if swing.lost or swing.largest >= math.pi / 2:
        return 0.0
    return 1 - math.sin(swing.largest)


class Stresses(NamedTuple):
    """Of every move that was looked at; `unchecked` are those for which it took too long."""

    plant: Plant
    each: tuple[Stress, ...]
    unchecked: tuple[PlannedMove, ...]


def stresses_of(plant: Plant, moves: Sequence[PlannedMove], enough: float) -> Stresses:
    """What `moves` ask; a burst is emulated unless its bounds leave at least `enough`."""
    each: list[Stress] = []
    unchecked: list[PlannedMove] = []
    emulated_s = 0.0
    known: set[tuple[Leg, ...]] = set()
    for axis in AXES:
        for burst in bursts(plant, moves, axis):
            bounded = plant.is_nominal and min(burst.margins) >= enough
            if not bounded and burst.legs not in known:
                emulated_s += sum(move.profile.duration_s for move in burst.moves)
                known.add(burst.legs)
            if not bounded and emulated_s > MOST_EMULATED_S:
                unchecked += burst.moves
                continue
            each += _bounded(burst) if bounded else _emulated(plant, burst)
    return Stresses(plant, tuple(each), tuple(unchecked))


def _bounded(burst: Burst) -> list[Stress]:
    return [
        Stress(move, burst.axis, burst.legs, i, margin, False, False)
        for i, (move, margin) in enumerate(zip(burst.moves, burst.margins, strict=True))
    ]


def _emulated(plant: Plant, burst: Burst) -> list[Stress]:
    fates = emulated(plant, burst.legs)
    return [
        Stress(move, burst.axis, burst.legs, i, margin, slips, True)
        for i, (move, (margin, slips)) in enumerate(zip(burst.moves, fates, strict=True))
    ]


@lru_cache(maxsize=4096)
def emulated(plant: Plant, legs: tuple[Leg, ...]) -> tuple[tuple[float, bool], ...]:
    """For each leg, from rest, the margin and whether the axis slips, as the emulator has it."""
    from mopro.emulator import Emulator

    machine = plant.machine
    endless = replace(machine.platen, length_m=_ENDLESS_M, width_m=_ENDLESS_M)
    emulator = Emulator(replace(machine, platen=endless), plant.payload_kg, _EMULATION_RATE_HZ)
    run = emulator.run(_program(legs), _Nowhere())
    return tuple((move.stall_margin or 0.0, move.slipped) for move in run.moves)


class _Nowhere:
    """The samples are not needed, only what became of the moves."""

    def write(self, columns: object) -> None:
        return


def _program(legs: tuple[Leg, ...]) -> ir.Program:
    """The legs as a program of axis 1 in microsteps."""
    span, axis = Span(1, 1, 1), (1,)
    ops: list[ir.Op] = [ir.SetUnits(span, axis, 1, 1)]
    for leg in legs:
        ops += [
            ir.SetVelocity(span, axis, Fraction(leg.velocity_u_s)),
            ir.SetAcceleration(span, axis, Fraction(leg.acceleration_u_s2)),
            ir.SetProfile(span, axis, leg.parabolic),
            ir.Move(span, axis, Fraction(leg.length_u)),
            ir.WaitAxis(span, axis),
            ir.Dwell(span, round(min(leg.rest_s, _LONGEST_REST_S) * 1000)),
        ]
    return ir.Program(tuple(ops), Source("burst", ""))


def largest_acceleration(
    plant: Plant, stress: Stress, acceleration: float, margin: float
) -> tuple[float, float] | None:
    """The largest acceleration, to three digits, that works in the place of `acceleration`.

    In the unit of `acceleration`, with the margin that it leaves, at least `margin`; each
    one tried is emulated. None if a hundredth does not work either.
    """
    shared = greatest_step_m_s2(plant.swinger.pull_out_m_s2, margin)
    works = shared / (stress.leg.acceleration_u_s2 * plant.machine.microstep_m) * acceleration
    works, fails = min(works, acceleration / 2), acceleration
    best: tuple[float, float] | None = None
    for _ in range(_PROBES):
        tried = _three_digits(works if best is None else (best[0] + fails) / 2)
        left = _margin_with(plant, stress, tried / acceleration)
        if left >= margin:
            best = max(best or (0.0, 0.0), (tried, left))
        else:
            fails, works = tried, tried * 0.6
    return best


def _margin_with(plant: Plant, stress: Stress, factor: float) -> float:
    """What is left where the acceleration of the move, and of all that share it, is another."""
    shared = stress.leg.acceleration_u_s2
    legs = tuple(
        leg._replace(acceleration_u_s2=shared * factor) if leg.acceleration_u_s2 == shared else leg
        for leg in stress.burst
    )
    fates = emulated(plant, legs)
    return min(
        0.0 if slips else margin
        for leg, (margin, slips) in zip(stress.burst, fates, strict=True)
        if leg.acceleration_u_s2 == shared
    )


def _three_digits(value: float) -> float:
    """`value` rounded down to three digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.floor(value / unit * (1 + 1e-12)) * unit:.3g}")
