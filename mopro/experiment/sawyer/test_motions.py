"""Test motions that excite different effects, and the text of the programs made of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mopro.machine import Machine
from mopro.units import INCH_M

_REST_MS = 300
_LONGEST_IN = 15.0
_SHARE_OF_TRAVEL = 0.7
# Alternatives may differ in force by a fifth, and a step of acceleration overshoots to twice.
_SHARE_OF_FORCE = 0.3
# From acceleration to braking the force steps by twice as much as from rest.
_SHARE_BETWEEN_RAMPS = 2 / 3
# The corners of a short stroke add up to twice the lag of a single one.
_SHARE_WHEN_RINGING = 0.3
_FASTEST_IN_S = 30.0
_INCH_M = float(INCH_M)


@dataclass(frozen=True)
class Excitation:
    """A test motion forth and back, repeated `times` times; in inches and seconds.

    It waits `wait_ms` before each stroke. An `endless` one is a program by itself, which
    repeats until it is stopped.
    """

    what: str
    distance: float
    velocity: float
    acceleration: float
    parabolic: bool = False
    wait_ms: int = _REST_MS
    both_axes: bool = False
    times: int = 1
    endless: bool = False

    def statements(self, axis: int, per_inch: int) -> Iterator[str]:
        """Statements in `.CMD`; the distance is rounded to whole microsteps.

        How the controller rounds a half microstep is unknown.
        """
        yield f"; {self.what}"
        axes = (axis, 3 - axis) if self.both_axes else (axis,)
        for n in axes:
            yield f"VEL{n} {self.velocity:.5f}"
            yield f"ACC{n} {self.acceleration / 1000:.5f}"
            yield f"PARA{n}{'+' if self.parabolic else '-'}"
        if self.endless:
            yield ":B1"
        distance = round(self.distance * per_inch) / per_inch
        for stroke in (distance, -distance) * self.times:
            yield f"WT{self.wait_ms}"
            yield from (f"MRI{n} {stroke:.6f}" for n in axes)
            yield from (f"WX{n}" for n in axes)
        yield "JUMP B1" if self.endless else f"WT{_REST_MS}"


def text_of(machine: Machine, axis: int, motions: Iterable[Excitation]) -> str:
    """Text of the program that runs `motions` one after the other, in inches."""
    per_inch = round(_INCH_M / machine.microstep_m)
    lines = [f"UU{per_inch:06d}/1"]
    for motion in motions:
        lines += motion.statements(axis, per_inch)
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Bounds:
    """Limits of a test motion: stroke (in) and acceleration `hardest` (in/s²).

    `natural_hz` is the natural frequency of the axis; `pitch` is in inches.
    """

    stroke: float
    hardest: float
    natural_hz: float
    pitch: float

    @classmethod
    def of(cls, machine: Machine, mass_kg: float, force_factor: float = 1.0) -> Bounds:
        """Limits for a moving mass of `mass_kg` and `force_factor` times the nominal force."""
        axis = machine.axis
        travel_m = (
            min(high - low for low, high in machine.travel_u().values()) * machine.microstep_m
        )
        force_N = force_factor * axis.pull_out_force_N
        return cls(
            stroke=min(_LONGEST_IN, _SHARE_OF_TRAVEL * travel_m / _INCH_M),
            hardest=_SHARE_OF_FORCE * force_N / mass_kg / _INCH_M,
            natural_hz=math.sqrt(force_factor * axis.stiffness_N_m / mass_kg) / math.tau,
            pitch=axis.pitch_m / _INCH_M,
        )


def moving_excitations(bounds: Bounds) -> list[Excitation]:
    """Test motions for a position sensor: speed, acceleration, stroke, ringing, resonance, wait."""
    return [
        *_of_speed(bounds),
        *_of_acceleration(bounds),
        *(_ringing(bounds, turns) for turns in (0.5, 1.5)),
        *_slow_scans(bounds),
    ]


def _of_speed(bounds: Bounds) -> Iterator[Excitation]:
    middling, half = min(200.0, bounds.hardest), bounds.stroke / 2
    for speed in (2.0, 6.0, 15.0, _FASTEST_IN_S):
        yield Excitation(f"speed {speed:g} in/s", min(half, 2 * speed), speed, middling)
    for stroke in (1.0, bounds.stroke):
        yield Excitation(f"stroke {stroke:.3g} in", stroke, 15.0, middling)
    yield Excitation("a long wait", half, 15.0, middling, wait_ms=10_000)
    yield Excitation("both axes", half, 15.0, middling, both_axes=True)


def _of_acceleration(bounds: Bounds) -> Iterator[Excitation]:
    for hard in (min(50.0, bounds.hardest), bounds.hardest / 2, bounds.hardest):
        yield Excitation(f"acceleration {hard:.0f} in/s2", bounds.stroke / 2, 25.0, hard)
        # The set velocity is just not reached, so the axis accelerates or brakes all the time.
        rate = _SHARE_BETWEEN_RAMPS * hard
        distance = min(bounds.stroke, 0.99 * _FASTEST_IN_S**2 / rate)
        what = f"nothing but acceleration, {rate:.0f} in/s2"
        yield Excitation(what, distance, _FASTEST_IN_S, rate, wait_ms=100, times=3)
    hardest = bounds.hardest
    yield Excitation("parabolic ramps", bounds.stroke, _FASTEST_IN_S, hardest, parabolic=True)


def _ringing(bounds: Bounds, turns: float) -> Excitation:
    """A short stroke whose steps of acceleration add up in the ringing that follows."""
    ramp_s = turns / bounds.natural_hz
    acceleration = _SHARE_WHEN_RINGING * bounds.hardest
    distance = acceleration * ramp_s**2
    what = f"ringing, ramps of {turns:g} periods"
    return Excitation(what, distance, 2 * acceleration * ramp_s, acceleration, times=4)


def _slow_scans(bounds: Bounds) -> Iterator[Excitation]:
    """Scans at speeds where a cyclic error of order 1, 2 or 4 excites the natural frequency."""
    gentle, resonant = min(50.0, bounds.hardest), bounds.pitch * bounds.natural_hz
    for order in (1, 2, 4):
        speed = resonant / order
        yield Excitation(
            f"slow scan {speed:.3g} in/s, resonance of order {order}", 1.5, speed, gentle
        )


def heating_excitations(bounds: Bounds) -> Iterator[Excitation]:
    """Test motions for a thermometer: endless strokes at several speeds, with rests between."""
    middling = min(200.0, bounds.hardest)
    for stroke, speed, wait_ms, both in (
        (1.0, 5.0, 2000, False),
        (1.0, _FASTEST_IN_S, 2000, False),
        (bounds.stroke, 5.0, 2000, False),
        (bounds.stroke, _FASTEST_IN_S, 2000, False),
        (bounds.stroke, _FASTEST_IN_S, 10_000, False),
        (bounds.stroke, 5.0, 2000, True),
        (bounds.stroke, _FASTEST_IN_S, 2000, True),
    ):
        axes = "both axes" if both else "one axis"
        what = f"stroke {stroke:.3g} in at {speed:g} in/s, {axes}, rests of {wait_ms} ms"
        yield Excitation(
            what, stroke, speed, middling, wait_ms=wait_ms, both_axes=both, endless=True
        )
