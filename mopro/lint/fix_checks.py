"""Checks of a fixed program against the one before, one for each kind of fix."""

from __future__ import annotations

from mopro.lint.subject import Subject
from mopro.motion import PlannedMove
from mopro.program import ir


def same_program(before: Subject, after: Subject) -> bool:
    """True if both have the same operations."""
    return before.program == after.program


def same_but_labels(before: Subject, after: Subject) -> bool:
    """True if they differ only in labels that no jump goes to."""
    return _without_idle_labels(before) == _without_idle_labels(after)


def _without_idle_labels(subject: Subject) -> list[ir.Op]:
    used = {op.name for op in subject.program.ops if isinstance(op, ir.Jump)}
    ops = subject.program.ops
    return [op for op in ops if not isinstance(op, ir.Label) or op.name in used]


def same_but_waits(before: Subject, after: Subject) -> bool:
    """True if they differ only in waits for an axis."""
    return _without_waits(before) == _without_waits(after)


def same_motion(before: Subject, after: Subject) -> bool:
    """True if every axis has the same moves at the same times."""
    return _moves(before) == _moves(after)


def same_motion_but_waits(before: Subject, after: Subject) -> bool:
    return same_but_waits(before, after) and same_motion(before, after)


def _without_waits(subject: Subject) -> list[ir.Op]:
    return [op for op in subject.program.ops if not isinstance(op, ir.WaitAxis)]


def _moves(subject: Subject) -> list[tuple[object, ...]]:
    return [_place_and_time(move) for move in subject.survey.schedule.moves]


def _place_and_time(move: PlannedMove) -> tuple[object, ...]:
    return move.strokes, move.profile, move.start_s
