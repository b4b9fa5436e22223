"""The timed command of a whole run: when each axis is told to be where.

The controller is open loop and knows only microsteps, and so does the schedule. Times
are in seconds, `_u` in microsteps, `_uu` in user units.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from typing import NamedTuple

from mopro.motion.profile import Profile, Segment, State
from mopro.motion.track import Track, brake
from mopro.program import ir
from mopro.source import Span


class Stroke(NamedTuple):
    """Motion of one axis in one move, between whole microsteps."""

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

    def acceleration_u_s2(self, axis: int) -> float:
        """The set acceleration of `axis`: of a minor one its share, so that both keep step."""
        stroke = next(stroke for stroke in self.strokes if stroke.axis == axis)
        if not stroke.length_u or not self.profile.distance:
            return self.profile.acceleration
        return self.profile.acceleration * abs(stroke.length_u) / self.profile.distance

    def in_uu(self, microsteps: float) -> float:
        """A length, velocity or acceleration in user units."""
        return microsteps * self.microsteps_per_uu.denominator / self.microsteps_per_uu.numerator


class Stopping(Enum):
    """Kind of stop before the end of a command.

    BRAKE: each axis at the acceleration set for its motion, to rest on a whole microstep;
    HOLD: at once, on the nearest whole microstep; CUT: at once, wherever the command is.
    """

    BRAKE = "brake"
    HOLD = "hold"
    CUT = "cut"


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
        """Final commanded position of `axis`, in microsteps from the start."""
        return round(self.tracks[axis].state(self.duration_s).position)

    def lines_at(self, at_s: float) -> tuple[int | None, int | None]:
        """The line under way at `at_s`, and the last one before it that is completed by then.

        A line that started a motion is completed when its last motion has ended.
        """
        begun = bisect_right(self.activity, at_s, key=lambda entry: entry[0])
        ended = self.complete and at_s >= self.duration_s
        moving = self._moving(at_s)
        before = range(begun - (1 if ended else 2), -1, -1)
        lines = (line for n in before if (line := self.activity[n][1]) not in moving)
        return self.activity[begun - 1][1] if begun and not ended else None, next(lines, None)

    def _moving(self, at_s: float) -> set[int]:
        """The lines whose motions are under way at `at_s`."""
        lines, axes = set(), set(self.tracks)
        nth = bisect_right(self.moves, at_s, key=lambda move: move.start_s)
        while axes and nth:
            nth -= 1
            if axes.intersection(self.moves[nth].axes) and self.moves[nth].end_s > at_s:
                lines.add(self.moves[nth].span.line)
            axes.difference_update(self.moves[nth].axes)
        return lines

    def stopped(self, at_s: float, stopping: Stopping) -> Schedule:
        """This schedule given up at `at_s`; it lasts until every axis is told to stand.

        Moves and source lines that had not begun by `at_s` are left out.
        """
        tracks = {axis: self._stopped(axis, at_s, stopping) for axis in self.tracks}
        ends_s = [t.segments[-1].end_s for t in tracks.values() if t.segments]
        return replace(
            self,
            duration_s=max([at_s, *ends_s]),
            complete=False,
            moves=tuple(move for move in self.moves if move.start_s < at_s),
            tracks=tracks,
            activity=[(t, line) for t, line in self.activity if t <= at_s],
        )

    def _stopped(self, axis: int, at_s: float, stopping: Stopping) -> Track:
        track = Track()
        track.add(self.tracks[axis].segments)
        state = track.state(at_s)
        track.cut(at_s)
        if state.velocity and stopping is not Stopping.CUT:
            held = Segment(at_s, at_s, at_s, float(round(state.position)), 0.0, 0.0, 0.0)
            braking = self._braking(axis, at_s, state) if stopping is Stopping.BRAKE else []
            track.add(braking or [held])
        return track

    def _braking(self, axis: int, at_s: float, state: State) -> list[Segment]:
        """Segments that brake `axis` from `state`; empty if no move states its acceleration."""
        moves = (m for m in reversed(self.moves) if axis in m.axes and m.start_s <= at_s)
        move = next(moves, None)
        return brake(at_s, state, move.acceleration_u_s2(axis)) if move else []
