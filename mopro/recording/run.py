"""Result of a run, and its summary in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mopro.motion.slips import per_millisecond
from mopro.program import Program
from mopro.recording.moves import MoveReport, Stall, stall_message
from mopro.source import Span


@dataclass(frozen=True)
class Run:
    """Result of running `program` on `machine`.

    `trip` is the event that stopped the machine early (kind, time_s, line, axis); `platen` the
    worst-case thermal expansion of the platen. `stalls` say when each axis slipped. `trouble`
    is the message of a run that a lost link or a stop ended. `rate_hz` is the mean rate of the
    samples, None if it is the one that was asked for. `moves_left_out` counts further moves that
    the file of a long run does not hold.
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
    stalls: tuple[Stall, ...] = ()
    rate_hz: float | None = None
    moves_left_out: int = 0

    @property
    def stalled(self) -> bool:
        """True if any move slipped, even if the axis returned to the same tooth."""
        return any(move.slipped for move in self.moves)

    def as_json(self) -> dict[str, Any]:
        return {
            "program": self.program,
            "machine": self.machine,
            "duration_s": self.duration_s,
            "stalled": self.stalled,
            "stalls": [asdict(stall) for stall in self.stalls],
            "loops_forever": self.loops_forever,
            "complete": self.complete,
            "trip": None if self.trip is None else dict(self.trip),
            "platen": None if self.platen is None else dict(self.platen),
            "moves": [asdict(move) for move in self.moves],
            **({} if self.rate_hz is None else {"rate_hz": self.rate_hz}),
            **({"trouble": self.trouble} if self.trouble else {}),
            **({"moves_left_out": self.moves_left_out} if self.moves_left_out else {}),
        }


def outcome(run: Run) -> str:
    """Summary of the run in a few sentences."""
    count = len(run.moves) + run.moves_left_out
    moves = f"{count} move{'' if count == 1 else 's'}"
    text = f"{run.program} on {run.machine}: {moves} in {run.duration_s:.6f} s."
    if run.stalled:
        text += f" The motor stalled in {sum(move.slipped for move in run.moves)} of them."
    if run.trip:
        what = "The motor became too hot"
        if run.trip["kind"] == "limit-switch":
            what = f"Axis {run.trip['axis']} ran into its limit switch"
        text += f" {what} at {run.trip['time_s']:.3f} s, in line {run.trip['line']}."
    return text


def stall_findings(run: Run, program: Program) -> list[tuple[Span, str, str | None]]:
    """Span, message and hint for each statement at which the motor stalled."""
    spans = {op.span.line: op.span for op in program.ops}
    by_line: dict[int, list[MoveReport]] = {}
    for move in run.moves:
        if move.slipped:
            by_line.setdefault(move.line, []).append(move)
    return [(spans[line], stall_message(moves), _hint(moves[0])) for line, moves in by_line.items()]


def _hint(move: MoveReport) -> str | None:
    return per_millisecond(move.acceleration, move.set_velocity, move.axes[0], move.unit)
