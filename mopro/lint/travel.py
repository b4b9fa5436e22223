"""Travel of each axis, and the extent of a program's moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from mopro.motion import PlannedMove

if TYPE_CHECKING:
    from mopro.lint.subject import Subject


class Travel(NamedTuple):
    """Ends of the travel of one axis, in microsteps from its start."""

    low_u: float
    high_u: float

    @property
    def length_u(self) -> float:
        return self.high_u - self.low_u


def travel_of(subject: Subject, axis: int) -> Travel:
    """The machine's travel of `axis`, or the configured one, relative to the configured start."""
    settings, microstep_m = subject.settings, subject.machine.microstep_m
    low_u, high_u = subject.machine.travel_u()[axis]
    if axis in settings.travel_m:
        high_u = settings.travel_m[axis] / 2 / microstep_m
        low_u = -high_u
    start_u = settings.start_m.get(axis, 0.0) / microstep_m
    return Travel(low_u - start_u, high_u - start_u)


def extent_u(moves: tuple[PlannedMove, ...], axis: int) -> tuple[int, int]:
    """Lowest and highest position of `axis` in `moves`, in microsteps."""
    ends = [
        end
        for move in moves
        for stroke in move.strokes
        if stroke.axis == axis
        for end in (stroke.start_u, stroke.end_u)
    ]
    return min(ends, default=0), max(ends, default=0)
