"""What came of a run, in all and in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mopro.program import Program
from mopro.recording.moves import MoveReport, stall_message
from mopro.source import Span


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


def outcome(run: Run) -> str:
    """The run in one sentence."""
    moves = f"{len(run.moves)} move{'' if len(run.moves) == 1 else 's'}"
    text = f"{run.program} on {run.machine}: {moves} in {run.duration_s:.6f} s."
    if run.stalled:
        text += f" The motor stalled in {sum(move.slipped for move in run.moves)} of them."
    if run.trip:
        what = "The motor became too hot"
        if run.trip["kind"] == "limit-switch":
            what = f"Axis {run.trip['axis']} ran into its limit switch"
        text += f" {what} at {run.trip['time_s']:.3f} s, in line {run.trip['line']}."
    return text


def stalls(run: Run, program: Program) -> list[tuple[Span, str]]:
    """Each statement at which the motor stalled, and by how many pitches each time."""
    spans = {op.span.line: op.span for op in program.ops}
    by_line: dict[int, list[MoveReport]] = {}
    for move in run.moves:
        if move.slipped:
            by_line.setdefault(move.line, []).append(move)
    return [(spans[line], stall_message(moves)) for line, moves in by_line.items()]
