"""Outcome of a move, its report in a run, and that report as table cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from mopro.motion import PlannedMove
from mopro.units import length_unit_name

_MOST_LOSSES = 5


@dataclass(frozen=True)
class MoveOutcome:
    """Observed result of a move on one axis, or the worst of its axes; None if not observed.

    `max_lag_m` is the largest following error, counted from the tooth that held the axis at
    the start; `stall_margin` is 1 - |F|/F0 at its least, 0 for a lag of a quarter pitch or
    more, where the force falls again; `lost_pitches` is positive if the axis fell behind.
    `complete` is false if the run ended during the move.
    """

    max_lag_m: float | None = None
    stall_margin: float | None = None
    lost_pitches: int = 0
    slipped: bool = False
    complete: bool = True

    @classmethod
    def worst(cls, axes: Sequence[MoveOutcome]) -> MoveOutcome:
        """The worst outcome of a move's axes."""
        return cls(
            max_lag_m=max((a.max_lag_m for a in axes if a.max_lag_m is not None), default=None),
            stall_margin=min(
                (a.stall_margin for a in axes if a.stall_margin is not None), default=None
            ),
            lost_pitches=max((a.lost_pitches for a in axes), key=abs),
            slipped=any(a.slipped for a in axes),
            complete=all(a.complete for a in axes),
        )


@dataclass(frozen=True)
class Stall:
    """The slip of one axis in a move, or while it rang after it.

    `time_s` is when the axis was first more than half a pitch from its tooth, None if nobody
    observed it; `line` that of the move; `lost_pitches` are positive if the axis fell behind.
    """

    time_s: float | None
    line: int
    axis: int | None
    lost_pitches: int


@dataclass(frozen=True)
class MoveReport:
    """One move: its command and its outcome.

    Lengths are in `unit` (the program's user unit), velocities in `unit`/s and the
    acceleration in `unit`/s². Distance, velocities and acceleration are those of the
    major axis, which comes first in `axes`. The last five fields are those of the
    `MoveOutcome`, the worst of all axes, with the lag in `unit`.
    """

    line: int
    axes: list[int]
    profile: str
    distance: float
    unit: str
    set_velocity: float
    peak_velocity: float
    acceleration: float
    start_s: float
    duration_s: float
    max_lag: float | None
    stall_margin: float | None
    lost_pitches: int
    slipped: bool
    complete: bool

    @classmethod
    def of(cls, move: PlannedMove, outcome: MoveOutcome, microstep_m: float) -> MoveReport:
        """The report of `move` with its `outcome`."""
        metres_per_uu = move.microsteps_per_uu * Fraction(microstep_m).limit_denominator(10**9)
        lag_m = outcome.max_lag_m
        return cls(
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


@dataclass(frozen=True)
class Repeated:
    """A move that a program makes `count` times; `worst` has its first time and worst outcome.

    Its lost pitches are those of all times.
    """

    worst: MoveReport
    count: int

    @property
    def cells(self) -> list[str]:
        """One cell for each of `folded_columns`."""
        move = self.worst
        peak, set_velocity = f"{move.peak_velocity:.4g}", f"{move.set_velocity:.4g}"
        return [
            f"{move.line}" if self.count == 1 else f"{move.line} × {self.count}",
            "+".join(map(str, move.axes)),
            move.profile + ("" if move.complete else " cut"),
            f"{move.distance:g}",
            peak if peak == set_velocity else f"{peak} of {set_velocity}",
            f"{move.duration_s:.6f}",
            "-" if move.max_lag is None else f"{move.max_lag:.3g}",
            "-" if move.stall_margin is None else f"{move.stall_margin:.0%}",
            f"{move.lost_pitches:+d}" if move.slipped else "0",
        ]


def folded(moves: Iterable[MoveReport]) -> list[Repeated]:
    """`moves` with those of one statement that went alike in one, in the order of their first."""
    groups: dict[tuple[object, ...], list[MoveReport]] = {}
    for move in moves:
        alike = (*move.axes, move.profile, move.distance, move.complete, move.slipped)
        groups.setdefault((move.line, alike), []).append(move)
    return [Repeated(_worst(group), len(group)) for group in groups.values()]


def _worst(moves: Sequence[MoveReport]) -> MoveReport:
    return replace(
        moves[0],
        max_lag=max((m.max_lag for m in moves if m.max_lag is not None), default=None),
        stall_margin=min(
            (m.stall_margin for m in moves if m.stall_margin is not None), default=None
        ),
        lost_pitches=sum(m.lost_pitches for m in moves),
    )


def folded_columns(unit: str) -> list[str]:
    """The heads of the columns of `Repeated.cells`, for lengths in `unit`."""
    return [
        "line", "axis", "profile", f"distance\n({unit})", f"velocity\n({unit}/s)", "time\n(s)",
        f"largest\nlag ({unit})", "stall\nmargin", "pitches\nlost",
    ]  # fmt: skip


def stall_message(moves: Sequence[MoveReport]) -> str:
    """Message with the pitches lost in the `moves` of one statement, all of which slipped."""
    axes = "+".join(map(str, moves[0].axes))
    if not any(move.lost_pitches for move in moves):
        return f"axis {axes} stalled here: it slipped, and fell back into its own tooth"
    lost = ", ".join(f"{move.lost_pitches:+d}" for move in moves[:_MOST_LOSSES])
    more = f" and {len(moves) - _MOST_LOSSES} more times" if len(moves) > _MOST_LOSSES else ""
    return f"axis {axes} stalled here: it lost {lost} pitches{more}"
