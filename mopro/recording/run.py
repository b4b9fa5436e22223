"""Result of a run, its summary in words, and what a recording's header keeps of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from mopro.motion.profile import per_millisecond
from mopro.program import Program
from mopro.recording.moves import MoveReport, Stall, stall_message
from mopro.source import Span

# -- the result -------------------------------------------------------------------------------
# Result of a run, and its summary in words.


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


# -- in a header ------------------------------------------------------------------------------
# A run as it is kept in the header of its recording, and read again from there.
#
# A recording may come from anywhere: every value is checked for its kind.

# Moves and stalls that a header keeps: those of an hour and a half of TEMP1, in less than half
# of the bytes that a header may have.
MOST_MOVES = 5000
MOST_STALLS = 100


def story_of(run: Run) -> dict[str, Any]:
    """The run as JSON, its moves as columns; of very many moves the first ones."""
    story = replace(run, moves=()).as_json()
    del story["stalled"]
    kept = run.moves[:MOST_MOVES]
    story["moves"] = {key: [getattr(move, key) for move in kept] for key in _MOVE}
    story["stalls"] = story["stalls"][:MOST_STALLS]
    story["moves_left_out"] = run.moves_left_out + len(run.moves) - len(kept)
    return story


def run_of(story: object) -> Run:
    """The run that `story_of` stored; ValueError for anything else."""
    stated = _mapping(story)
    columns = _fields(stated.get("moves"), dict.fromkeys(_MOVE, _list))
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise ValueError("the columns of its moves have different lengths")
    rows = zip(*columns.values(), strict=True)
    moves = [MoveReport(**_fields(dict(zip(_MOVE, row, strict=True)), _MOVE)) for row in rows]
    stalls = [Stall(**_fields(stall, _STALL)) for stall in _list(stated.get("stalls"))]
    own = {key: stated.get(key) for key in _RUN}
    return Run(moves=tuple(moves), stalls=tuple(stalls), **_fields(own, _RUN))


# -- kinds of values ---------------------------------------------------------------

Kind = Callable[[Any], Any]


def _fields(stated: object, kinds: Mapping[str, Kind]) -> dict[str, Any]:
    """The values of exactly these keys, each checked by its kind."""
    values = _mapping(stated)
    if values.keys() != kinds.keys():
        raise ValueError(f"expected the keys {', '.join(kinds)}")
    return {key: kind(values[key]) for key, kind in kinds.items()}


def _of(*types: type) -> Kind:
    """Values of exactly one of `types`; numbers are finite."""

    def check(value: Any) -> Any:
        if type(value) not in types or (isinstance(value, float) and not math.isfinite(value)):
            raise ValueError(f"{str(value)[:40]!r} is no {types[0].__name__}")
        return value

    return check


def _mapping(value: object) -> dict[str, Any]:
    checked: dict[str, Any] = _of(dict)(value)
    return checked


def _list(value: object) -> list[Any]:
    checked: list[Any] = _of(list)(value)
    return checked


def _optional(kind: Kind) -> Kind:
    return lambda value: None if value is None else kind(value)


def _axes(value: object) -> list[int]:
    axes = [_whole(axis) for axis in _list(value)]
    if not axes:
        raise ValueError("a move has no axis")
    return axes


def _trip(value: object) -> dict[str, Any]:
    return _fields(
        value, {"kind": _text, "time_s": _number, "line": _whole, "axis": _optional(_whole)}
    )


def _platen(value: object) -> dict[str, Any]:
    return {key: _figures(figures) for key, figures in _mapping(value).items()}


def _figures(value: object) -> Any:
    return [_number(figure) for figure in value] if isinstance(value, list) else _number(value)


_text, _flag, _whole, _number = _of(str), _of(bool), _of(int), _of(float, int)
_MOVE: dict[str, Kind] = {
    field.name: {
        "int": _whole, "list[int]": _axes, "str": _text, "float": _number, "bool": _flag,
        "float | None": _optional(_number),
    }[str(field.type)]
    for field in fields(MoveReport)
}  # fmt: skip
_STALL = {
    "time_s": _optional(_number), "line": _whole, "axis": _optional(_whole), "lost_pitches": _whole,
}  # fmt: skip
_RUN = {
    "program": _text, "machine": _text, "duration_s": _number, "loops_forever": _flag,
    "complete": _flag, "trip": _optional(_trip), "platen": _optional(_platen),
    "trouble": _optional(_text), "rate_hz": _optional(_number), "moves_left_out": _whole,
}  # fmt: skip
