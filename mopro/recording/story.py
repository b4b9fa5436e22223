"""A run as it is kept in the header of its recording, and read again from there.

A recording may come from anywhere: every value is checked for its kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from mopro.recording.moves import MoveReport, Stall
from mopro.recording.run import Run

# Moves and stalls that a header keeps: those of an hour and a half of TEMP1, in less than half
# of the bytes that a header may have.
MOST_MOVES = 5000
MOST_STALLS = 100


def story_of(run: Run) -> dict[str, Any]:
    """The run as JSON, its moves as columns; of very many moves the first ones."""
    story = {key: value for key, value in run.as_json().items() if key not in ("stalled", "moves")}
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
