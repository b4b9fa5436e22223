"""Phases of a move: accelerating, cruising, decelerating."""

from __future__ import annotations

from dataclasses import dataclass

from mopro.recording.moves import MoveReport

ACCELERATE, CRUISE, DECELERATE = "accelerate", "cruise", "decelerate"
PHASES = (ACCELERATE, CRUISE, DECELERATE)
# Duration of a ramp to velocity v at acceleration a, as a multiple of v/a: a parabolic ramp
# takes twice as long. The other profiles have no cruise.
_RAMP = {"trapezoid": 1.0, "smooth": 2.0}


@dataclass(frozen=True)
class Phase:
    """One of `PHASES`, from `start_s` to `end_s`."""

    name: str
    start_s: float
    end_s: float


def phases_of(move: MoveReport) -> list[Phase]:
    """The phases of `move` in time; empty ones are left out."""
    half = move.duration_s / 2
    ramp = half
    if move.profile in _RAMP and move.acceleration > 0:
        ramp = min(half, _RAMP[move.profile] * move.peak_velocity / move.acceleration)
    end_s = move.start_s + move.duration_s
    corners = (move.start_s, move.start_s + ramp, end_s - ramp, end_s)
    found = map(Phase, PHASES, corners[:-1], corners[1:])
    # The cruise of a triangle is no longer than rounding.
    return [p for p in found if p.end_s - p.start_s > 1e-9 * max(move.duration_s, 1e-9)]
