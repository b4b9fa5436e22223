"""How a planned move went, in the program's own units: the row that every back end gives."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from mopro.motion import PlannedMove
from mopro.recording import MoveReport
from mopro.units import length_unit_name


@dataclass(frozen=True)
class Outcome:
    """What was seen of one move, the worst of its axes; None where nobody could see it.

    `max_lag_m` is the largest following error, `stall_margin` the share of the pull-out
    force never called upon, `lost_pitches` positive where the axis stayed behind.
    """

    max_lag_m: float | None = None
    stall_margin: float | None = None
    lost_pitches: int = 0
    slipped: bool = False
    complete: bool = True


def move_report(move: PlannedMove, outcome: Outcome, microstep_m: float) -> MoveReport:
    """The row of `move`: what was commanded, and its `outcome`."""
    metres_per_uu = move.microsteps_per_uu * Fraction(microstep_m).limit_denominator(10**9)
    lag_m = outcome.max_lag_m
    return MoveReport(
        line=move.span.line,
        axes=list(move.axes),
        profile=str(move.profile.shape),
        distance=move.distance_uu,
        unit=length_unit_name(metres_per_uu),
        set_velocity=move.in_uu(move.profile.velocity),
        peak_velocity=move.in_uu(move.profile.peak_velocity),
        acceleration=move.in_uu(move.profile.acceleration),
        start_s=move.start_s,
        duration_s=move.profile.duration_s,
        max_lag=None if lag_m is None else move.in_uu(lag_m / microstep_m),
        stall_margin=outcome.stall_margin,
        lost_pitches=outcome.lost_pitches,
        slipped=outcome.slipped,
        complete=outcome.complete,
    )
