"""Rules about the commanded motion; of the machine they need the microstep only."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from mopro.errors import Diagnostic, Severity
from mopro.language import ast
from mopro.lint.rule import (
    Finding,
    Rule,
    Settings,
    Stage,
    Subject,
    extent_u,
    same_but_waits,
    same_motion,
    same_motion_but_waits,
    travel_of,
)
from mopro.motion import PlannedMove, Shape
from mopro.program import AXES, ir
from mopro.source import Span

_READY = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
_SHORT = (Shape.TRIANGLE, Shape.PARABOLA)
# Share of a distance above which its rounding is reported.
_ROUNDING_SHARE = Fraction(1, 100)
# From here on (microsteps) half a microstep is no more than that share.
_MOST_ROUNDED_U = 50


def first_by_span(moves: tuple[PlannedMove, ...]) -> Iterator[PlannedMove]:
    """Each statement's first move."""
    seen: set[Span] = set()
    for move in moves:
        if move.span not in seen:
            seen.add(move.span)
            yield move


def _statement_text(subject: Subject, span: Span) -> str:
    return subject.program.source.line(span.line)[span.column - 1 : span.end_column - 1]


def _wait_before(subject: Subject | None, finding: Diagnostic) -> str | None:
    """The statement with a wait for its axes in front."""
    if subject is None:
        return None
    op = subject.op_at[finding.span]
    axis = op.axes[0] if isinstance(op, ir.AxisOp) and len(op.axes) == 1 else 0
    return f"WX{axis}\n{_statement_text(subject, finding.span)}"


def _end_without_wait(rule: Rule, subject: Subject) -> Iterator[Finding]:
    moving = subject.survey.left_moving
    if not moving:
        return
    last = list(subject.program.reachable())[-1]
    axes = " and ".join(map(str, moving))
    wait = f"WX{next(iter(moving)) if len(moving) == 1 else 0}"
    yield rule.at(
        last.span,
        f"the program ends here, while axis {axes} moves on for {max(moving.values()):.3f} s",
        f"put `{wait}` at the end",
        f"{_statement_text(subject, last.span)}\n{wait}",
    )


def _wait_on_idle_axis(rule: Rule, subject: Subject) -> Iterator[Finding]:
    for op in subject.program.reachable():
        if isinstance(op, ir.WaitAxis) and op.span not in subject.survey.served:
            axes = " and ".join(map(str, op.axes))
            message = f"axis {axes} has not moved since it was last waited for"
            yield rule.at(op.span, message, "wait for the axis that moves, or remove the wait")


def _target_without_go(rule: Rule, subject: Subject) -> Iterator[Finding]:
    for op in subject.program.reachable():
        if isinstance(op, ir.SetTarget) and op.span not in subject.survey.served:
            axes = " and ".join(map(str, op.axes))
            message = f"no GO takes axis {axes} to this target"
            yield rule.at(op.span, message, "put `GO` after it, before another target is set")


def _never_reaches_velocity(rule: Rule, subject: Subject) -> Iterator[Finding]:
    for move in first_by_span(subject.distinct_moves):
        if move.profile.shape not in _SHORT or not move.profile.distance:
            continue
        unit = subject.unit(move.microsteps_per_uu)
        peak, velocity = (
            move.in_uu(v) for v in (move.profile.peak_velocity, move.profile.velocity)
        )
        yield rule.at(
            move.span,
            f"the move never reaches its {velocity:.6g} {unit}/s: as a {move.profile.shape} it "
            f"peaks at {peak:.4g} {unit}/s",
            "lengthen the move, raise the acceleration or set the velocity that is meant",
        )


def _rounds_to_microsteps(rule: Rule, subject: Subject) -> Iterator[Finding]:
    distances = subject.survey.distances_u
    for index in sorted(subject.reached):
        op = subject.program.ops[index]
        if not isinstance(op, ir.Move | ir.SetTarget) or op.absolute:
            continue
        distance_u = next(
            (distances[op.span, a] for a in op.axes if (op.span, a) in distances), Fraction(0)
        )
        if not -_MOST_ROUNDED_U < distance_u < _MOST_ROUNDED_U:
            continue
        if distance_u and abs(round(distance_u) - distance_u) > _ROUNDING_SHARE * abs(distance_u):
            meant = op.distance_uu / distance_u * round(distance_u)
            message = (
                f"{float(op.distance_uu):g} is {float(distance_u):.6g} microsteps: the axis moves "
                f"{round(distance_u)}, which is {float(meant):.6g}"
            )
            fix = _with_value(subject, index, meant)
            yield rule.at(op.span, message, "microsteps cannot be divided", fix)


def _with_value(subject: Subject, index: int, value: Fraction) -> str | None:
    """The statement with another value, or None if no decimal is that value."""
    statement = subject.tree.statements[index]
    assert isinstance(statement, ast.Move | ast.Target), "the rule asks for no other"
    from mopro.program.statements import decimal

    try:
        number = decimal(value)
    except ValueError:
        return None
    text = subject.program.source.line(statement.span.line)
    return text[statement.span.column - 1 : statement.value.column - 1] + number


def _drift_per_loop(rule: Rule, subject: Subject) -> Iterator[Finding]:

    laps = subject.survey.laps
    if len(laps) < 2:
        return
    moves = subject.survey.schedule.moves[laps[-2].moves : laps[-1].moves]
    jump = next(op for op in reversed(list(subject.program.reachable())) if isinstance(op, ir.Jump))
    for axis, before, after in zip(AXES, laps[-2].position_u, laps[-1].position_u, strict=True):
        drift_u = after - before
        if not drift_u:
            continue
        travel = travel_of(subject, axis)
        low, high = extent_u(moves, axis)
        past = high - travel.high_u if drift_u > 0 else travel.low_u - low
        rounds = max(1, len(laps) + int(-past // abs(float(drift_u))) + 1)
        drift = subject.length(float(drift_u), moves[-1].microsteps_per_uu)
        yield rule.at(
            jump.span,
            f"each round leaves axis {axis} {drift} further on: from where it "
            f"starts, it leaves its travel in round {rounds}",
            "let the distances of a round add up to 0",
        )


def _reported(name: str, what: str, why: str, bad: str, good: str, **more: Any) -> Rule:
    """A rule whose findings come from the schedule."""
    return Rule(name, Stage.MOTION, Severity.ERROR, what, why, bad, good, **more)


def _warning(name: str, check: Any, severity: Severity = Severity.WARNING, **texts: Any) -> Rule:
    return Rule(name, Stage.MOTION, severity, check=check, **texts)


RULES = (
    _reported(
        "loop-without-time",
        "A loop in which no time passes.",
        "The controller would loop for ever without moving the motor.",
        ":B1\nPARA1+\nJUMP B1\n",
        ":B1\nPARA1+\nWT1\nJUMP B1\n",
    ),
    _reported(
        "missing-units",
        "A move of an axis that has no user unit.",
        "Without one the distance is undefined.",
        "VEL1 40.0\nACC1 0.25\nMRI1 15.0\nWX1\n",
        _READY + "MRI1 15.0\nWX1\n",
    ),
    _reported(
        "missing-velocity",
        "A move of an axis that has no velocity.",
        "The value that the controller would use is not known.",
        "UU012500/1\nACC1 0.25\nMRI1 15.0\nWX1\n",
        _READY + "MRI1 15.0\nWX1\n",
    ),
    _reported(
        "missing-acceleration",
        "A move of an axis that has no acceleration.",
        "The value that the controller would use is not known.",
        "UU012500/1\nVEL1 40.0\nMRI1 15.0\nWX1\n",
        _READY + "MRI1 15.0\nWX1\n",
    ),
    _reported(
        "move-on-moving-axis",
        "A second move of an axis that is still in its first.",
        "What happens to the first move is not known, which is dangerous on a machine.",
        _READY + "MRI1 15.0\nMRI1 -15.0\nWX1\n",
        _READY + "MRI1 15.0\nWX1\nMRI1 -15.0\nWX1\n",
        fix=_wait_before,
        fix_check=same_but_waits,
    ),
    _reported(
        "go-without-target",
        "A GO with no target set.",
        "Nothing moves, although a move was intended.",
        "GO\n",
        _READY + "MR1 8.0\nMR2 4.0\nGO\nWX0\n",
    ),
    _reported(
        "endless-motion",
        "A continuous motion that is never stopped (extended grammar).",
        "The motor runs until it reaches the end of its travel.",
        _READY + "MC1 10.0\nWT500\n",
        _READY + "MC1 10.0\nWT500\nST1\nWX1\n",
        example=Settings(grammar="extended"),
    ),
    _reported(
        "motion-out-of-range",
        "A move that lasts longer than 31 days, or leads or goes beyond what can be computed.",
        "A factor of the user unit or a digit too many or too few; the controller's registers "
        "hold less.",
        "UU012500/1\nVEL0 0.000001\nACC0 0.25\nMRI1 15.0\nWX1\n",
        _READY + "MRI1 15.0\nWX1\n",
    ),
    _warning(
        "end-without-wait",
        _end_without_wait,
        what="A program that ends while an axis is moving.",
        why="The next program, or the next reading, would begin on a moving axis.",
        bad=_READY + "MRI1 15.0\n",
        good=_READY + "MRI1 15.0\nWX1\n",
        fix_check=same_motion_but_waits,
    ),
    _warning(
        "wait-on-idle-axis",
        _wait_on_idle_axis,
        what="A wait for an axis that has not moved since the last wait for it.",
        why="It has no effect: most often the digit of another axis was intended.",
        bad=_READY + "MRI1 15.0\nWX1\nWX2\n",
        good=_READY + "MRI1 15.0\nMRI2 10.0\nWX1\nWX2\n",
    ),
    _warning(
        "target-without-go",
        _target_without_go,
        what="A target without a GO.",
        why="The intended move does not happen.",
        bad=_READY + "MR1 8.0\n",
        good=_READY + "MR1 8.0\nGO\nWX1\n",
    ),
    _warning(
        "drift-per-loop",
        _drift_per_loop,
        what="A loop that does not end where it began.",
        why="The difference adds up, until the motor reaches the end of its travel.",
        bad=_READY + ":B1\nMRI1 8.0\nWX1\nMRI1 -7.99\nWX1\nJUMP B1\n",
        good=_READY + ":B1\nMRI1 8.0\nWX1\nMRI1 -8.0\nWX1\nJUMP B1\n",
    ),
    _warning(
        "never-reaches-velocity",
        _never_reaches_velocity,
        Severity.NOTE,
        what="A move too short for its velocity: it becomes a triangle or a parabola.",
        why="The set velocity, and results computed from it, then do not apply to the move.",
        bad=_READY + "MRI1 6.0\nWX1\n",
        good=_READY + "MRI1 7.0\nWX1\n",
    ),
    _warning(
        "rounds-to-microsteps",
        _rounds_to_microsteps,
        Severity.NOTE,
        what="A distance that rounding to whole microsteps changes by more than one percent.",
        why="The axis moves by a different distance from the one written, or not at all.",
        bad="UU012500/1\nVEL0 0.01\nACC0 0.25\nMRI1 0.0001\nWX1\n",
        good="UU012500/1\nVEL0 0.01\nACC0 0.25\nMRI1 0.00016\nWX1\n",
        fix_check=same_motion,
    ),
)
