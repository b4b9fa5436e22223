"""Rules about the extent of the moves against the travel of the axes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mopro.errors import Severity
from mopro.lint.rule import Finding, Rule, Settings, Stage, Subject, extent_u, travel_of
from mopro.motion import PlannedMove
from mopro.program import AXES

_READY = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"


def _moves_of_travel(subject: Subject) -> tuple[PlannedMove, ...]:
    """All moves; those of a drifting loop for the first round only, as drift has its own rule."""
    survey = subject.survey
    laps = survey.laps
    if len(laps) > 1 and laps[-1].position_u != laps[-2].position_u:
        return survey.schedule.moves[: laps[0].moves]
    return survey.schedule.moves


def _off_travel(rule: Rule, subject: Subject) -> Iterator[Finding]:
    moves = _moves_of_travel(subject)
    for axis in AXES:
        travel = travel_of(subject, axis)
        low_u, high_u = extent_u(moves, axis)
        if high_u - low_u <= travel.length_u + 0.5:
            continue
        move = _first_beyond(moves, axis, travel.length_u)
        units = move.microsteps_per_uu
        yield rule.at(
            move.span,
            f"the moves of axis {axis} reach over {subject.length(high_u - low_u, units)}, its "
            f"travel is {subject.length(travel.length_u, units)}: no place to start from fits",
            "shorten the moves",
        )


def _first_beyond(moves: Iterable[PlannedMove], axis: int, length_u: float) -> PlannedMove:
    """The first move with which the extent of `axis` exceeds `length_u`."""
    low_u = high_u = 0
    last: PlannedMove | None = None
    for move in moves:
        for stroke in move.strokes:
            if stroke.axis == axis:
                last = move
                low_u, high_u = min(low_u, stroke.end_u), max(high_u, stroke.end_u)
        if last is not None and high_u - low_u > length_u + 0.5:
            return last
    assert last is not None, "asked only where the moves do not fit"
    return last


def _limit_switch(rule: Rule, subject: Subject) -> Iterator[Finding]:
    moves = _moves_of_travel(subject)
    for axis in subject.settings.start_m:
        travel = travel_of(subject, axis)
        low_u, high_u = extent_u(moves, axis)
        fits = high_u - low_u <= travel.length_u + 0.5
        if not fits or (low_u >= travel.low_u - 0.5 and high_u <= travel.high_u + 0.5):
            continue
        yield _meets_switch(rule, subject, axis, moves)


def _meets_switch(
    rule: Rule, subject: Subject, axis: int, moves: tuple[PlannedMove, ...]
) -> Finding:
    travel = travel_of(subject, axis)
    low_u, high_u = extent_u(moves, axis)
    for move in moves:
        places = [s.end_u for s in move.strokes if s.axis == axis]
        if any(p < travel.low_u - 0.5 or p > travel.high_u + 0.5 for p in places):
            break
    units = move.microsteps_per_uu
    over = subject.length(max(high_u - travel.high_u, travel.low_u - low_u), units)
    half = travel.length_u / 2
    start_u = subject.settings.start_m[axis] / subject.machine.microstep_m
    return rule.at(
        move.span,
        f"from its start at {subject.length(start_u, units)}, axis {axis} runs {over} past its "
        "limit switch",
        f"start it between {subject.length(-half - low_u, units)} and "
        f"{subject.length(half - high_u, units)} from the middle",
    )


RULES = (
    Rule(
        "off-travel",
        Stage.PHYSICS,
        Severity.WARNING,
        check=_off_travel,
        what="Moves that reach further than the travel of their axis, wherever they start.",
        why="The motor runs into the end of the platen, or out of the range of the instrument "
        "whose travel is configured.",
        bad=_READY + "MRI1 46.0\nWX1\n",
        good=_READY + "MRI1 20.0\nWX1\n",
    ),
    Rule(
        "limit-switch",
        Stage.PHYSICS,
        Severity.WARNING,
        check=_limit_switch,
        what="A move past a limit switch, from the configured start of the motor.",
        why="The controller then aborts the program. `start` in the configuration, or `--start`, "
        "is the start of an axis from the middle of its travel; without it the operator is "
        "assumed to place the motor so that the moves fit. The example starts axis 1 at 10 in.",
        bad=_READY + "MRI1 15.0\nWX1\n",
        good=_READY + "MRI1 12.0\nWX1\n",
        example=Settings(start_m={1: 0.254}),
    ),
)
