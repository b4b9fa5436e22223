"""The timed command of a whole run: when each axis is told to be where.

The controller is open loop and knows only microsteps, and so does the schedule. Times
are in seconds, `_u` in microsteps, `_uu` in user units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from mopro.motion.profile import Profile
from mopro.motion.track import Track
from mopro.program import ir
from mopro.source import Span


@dataclass(frozen=True, slots=True)
class Stroke:
    """What one axis covers in one move, between whole microsteps."""

    axis: int
    start_u: int
    end_u: int

    @property
    def length_u(self) -> int:
        return self.end_u - self.start_u


@dataclass(frozen=True, slots=True)
class PlannedMove:
    """One started motion; the first stroke is the major axis, whose profile governs.

    `distance_uu` is how far the program sends the major axis; its stroke is that rounded
    to whole microsteps.
    """

    span: Span
    strokes: tuple[Stroke, ...]
    profile: Profile
    start_s: float
    distance_uu: float
    microsteps_per_uu: Fraction

    @property
    def end_s(self) -> float:
        return self.start_s + self.profile.duration_s

    @property
    def axes(self) -> tuple[int, ...]:
        return tuple(stroke.axis for stroke in self.strokes)

    def in_uu(self, microsteps: float) -> float:
        """A length, velocity or acceleration in user units."""
        return microsteps * self.microsteps_per_uu.denominator / self.microsteps_per_uu.numerator


@dataclass(frozen=True)
class Schedule:
    """The timed command of a whole run.

    `complete` is false where the time asked for ended it. `activity` are the times from
    which a source line is the running one: the line that started the motion under way
    (the latest if there are several), or else the statement that the program waits at.
    """

    program: ir.Program
    duration_s: float
    complete: bool
    moves: tuple[PlannedMove, ...]
    tracks: Mapping[int, Track]
    activity: Sequence[tuple[float, int]]

    def final_u(self, axis: int) -> int:
        """Where the command leaves `axis`, in microsteps from the start."""
        return round(self.tracks[axis].state(self.duration_s).position)
