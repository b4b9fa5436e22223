"""The moves of a run as a person reads them."""

from __future__ import annotations

from mopro.program import Program
from mopro.recording.run import MoveReport, Run
from mopro.source import Span

_MOST_LOSSES = 5

MOVE_COLUMNS = (
    "line",
    "axes",
    "profile",
    "distance",
    "peak / set velocity",
    "duration (s)",
    "largest lag",
    "stall margin",
    "lost pitches",
)


def move_cells(move: MoveReport) -> list[str]:
    """One cell for each of `MOVE_COLUMNS`."""
    return [
        str(move.line),
        "+".join(map(str, move.axes)),
        move.profile + ("" if move.complete else " (cut short)"),
        f"{move.distance:g} {move.unit}",
        f"{move.peak_velocity:.4g} / {move.set_velocity:.4g} {move.unit}/s",
        f"{move.duration_s:.6f}",
        "-" if move.max_lag is None else f"{move.max_lag:.3g} {move.unit}",
        "-" if move.stall_margin is None else f"{move.stall_margin:.0%}",
        f"{move.lost_pitches:+d}" if move.slipped else "0",
    ]


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
    return [(spans[line], _stall_message(moves)) for line, moves in by_line.items()]


def _stall_message(moves: list[MoveReport]) -> str:
    axes = "+".join(map(str, moves[0].axes))
    if not any(move.lost_pitches for move in moves):
        return f"axis {axes} stalled here: it slipped, and fell back into its own tooth"
    lost = ", ".join(f"{move.lost_pitches:+d}" for move in moves[:_MOST_LOSSES])
    more = f" and {len(moves) - _MOST_LOSSES} more times" if len(moves) > _MOST_LOSSES else ""
    return f"axis {axes} stalled here: it lost {lost} pitches{more}"
