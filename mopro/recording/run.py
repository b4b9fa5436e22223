"""The outcome of a run: how each move went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class MoveReport:
    """One move as it was commanded and as it went.

    Lengths are in `unit` (the program's user unit), velocities in `unit`/s and the
    acceleration in `unit`/s². Distance, velocities and acceleration are those of the
    major axis, which comes first in `axes`; `max_lag` (largest following error),
    `stall_margin` (share of the pull-out force never called upon) and `lost_pitches`
    are the worst of all its axes. `complete` is false where the run ended first.
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


@dataclass(frozen=True)
class Run:
    """What came of running `program` on `machine`.

    `trip` is what stopped the machine before its time (kind, time_s, line, axis);
    `platen` how far the forcer's heat has stretched the platen, in the worst case.
    `trouble` says why and how a run ended that did not go its way: a lost link, a stop.
    """

    program: str
    machine: str
    duration_s: float
    loops_forever: bool
    complete: bool
    moves: tuple[MoveReport, ...]
    trip: Mapping[str, Any] | None = None
    platen: Mapping[str, Any] | None = None
    trouble: str | None = None

    @property
    def stalled(self) -> bool:
        """Whether any move slipped a tooth, even if it found the same one again."""
        return any(move.slipped for move in self.moves)

    def as_json(self) -> dict[str, Any]:
        return {
            "program": self.program,
            "machine": self.machine,
            "duration_s": self.duration_s,
            "stalled": self.stalled,
            "loops_forever": self.loops_forever,
            "complete": self.complete,
            "trip": None if self.trip is None else dict(self.trip),
            "platen": None if self.platen is None else dict(self.platen),
            "moves": [asdict(move) for move in self.moves],
            **({"trouble": self.trouble} if self.trouble else {}),
        }
