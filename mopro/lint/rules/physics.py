"""Rules about what the program does to a machine with its payload."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any

from mopro.errors import Severity
from mopro.language import ast
from mopro.lint.rule import Finding, Rule, Stage
from mopro.lint.settings import Settings
from mopro.lint.subject import Subject
from mopro.lint.travel import extent_u, travel_of
from mopro.motion import PlannedMove
from mopro.program import ir
from mopro.source import Span

_READY = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
# With less than this a move is not called safe, and no acceleration is proposed.
SAFE_MARGIN = 0.05
# What a faster profile must leave, and the share of time that makes it worth telling.
KEPT_MARGIN = 0.30
_WORTH_TELLING = 0.10
_MOST_PROPOSALS = 10
_MINUTE_S = 60.0


def _acceleration(subject: Subject, move: PlannedMove) -> tuple[float, str]:
    """The acceleration that governs a move, in user units per second squared, and its unit."""
    unit = subject.unit(move.microsteps_per_uu)
    return move.in_uu(move.profile.acceleration), f"{unit}/s²"


def _stall(rule: Rule, subject: Subject) -> Iterator[Finding]:
    told: set[Span] = set()
    for stress in subject.stresses.each:
        span = stress.move.span
        if not stress.slips or span in told:
            continue
        told.add(span)
        value, unit = _acceleration(subject, stress.move)
        message = f"axis {stress.axis} stalls in this move at {value:.4g} {unit}: margin 0 %"
        hint = _what_works(subject, stress, value, unit) if len(told) <= _MOST_PROPOSALS else None
        yield rule.at(span, message, hint)
    unchecked = sorted({move.span for move in subject.stresses.unchecked})
    if unchecked:
        message = (
            f"from here on {len(unchecked)} statements with moves are not checked for stall: they "
            "differ too much to be emulated here"
        )
        yield rule.at(unchecked[0], message, "see `mopro run --emulate`")


def _what_works(subject: Subject, stress: Any, value: float, unit: str) -> str:
    from mopro.lint.stress import largest_acceleration

    found = largest_acceleration(subject.stresses.plant, stress, value, SAFE_MARGIN)
    if found is None:
        return f"no acceleration from a hundredth of {value:.4g} {unit} on works"
    works, margin = found
    axis = stress.move.axes[0]
    return (
        f"the largest acceleration that works is {works:g} {unit}, `ACC{axis} {works / 1000:g}`, "
        f"with a margin of {margin:.0%}"
    )


def _low_margin(rule: Rule, subject: Subject) -> Iterator[Finding]:
    least: dict[Span, Any] = {}
    stalled = {stress.move.span for stress in subject.stresses.each if stress.slips}
    for stress in subject.stresses.each:
        span = stress.move.span
        if stress.margin < subject.settings.low_margin and span not in stalled:
            least[span] = min(least.get(span, stress), stress, key=lambda s: s.margin)
    for span, stress in least.items():
        yield rule.at(
            span,
            f"axis {stress.axis} has a margin of {stress.margin:.0%} against stall in this move: "
            f"less than {subject.settings.low_margin:.0%}",
            "lower the acceleration or the payload",
        )


def _over_temperature(rule: Rule, subject: Subject) -> Iterator[Finding]:
    from mopro.lint.warmth import can_overheat, overheating

    loops = subject.program.loops_forever
    duration_s = subject.survey.schedule.duration_s
    if not loops and not can_overheat(subject.machine, duration_s):
        return
    hot = overheating(subject.machine, subject.survey, loops)
    if hot is None:
        return
    minutes = hot.after_s / _MINUTE_S
    yield rule.at(
        hot.span,
        f"after {minutes:.3g} min the motor passes its rated "
        f"{subject.machine.heat.rated_C:.4g} °C on the way to {hot.final_C:.4g} °C",
        "rest longer between moves, or stop in time",
    )


def _moves_of_travel(subject: Subject) -> tuple[PlannedMove, ...]:
    """All moves, but of a drifting loop those of the first round: drift has its own rule."""
    survey = subject.survey
    laps = survey.laps
    if len(laps) > 1 and laps[-1].position_u != laps[-2].position_u:
        return survey.schedule.moves[: laps[0].moves]
    return survey.schedule.moves


def _off_travel(rule: Rule, subject: Subject) -> Iterator[Finding]:
    moves = _moves_of_travel(subject)
    for axis in subject.axes:
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
    """The move with which the places gone to no longer fit into `length_u`."""
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


def _slower_than_needed(rule: Rule, subject: Subject) -> Iterator[Finding]:
    from mopro.lint.rules.motion import first_by_span
    from mopro.lint.stress import Leg, emulated
    from mopro.lint.swing import greatest_step_m_s2
    from mopro.motion import plan_profile

    plant = subject.stresses.plant
    step_u_s2 = greatest_step_m_s2(plant.swinger.pull_out_m_s2, KEPT_MARGIN)
    step_u_s2 /= subject.machine.microstep_m
    for move in first_by_span(subject.distinct_moves):
        profile = move.profile
        if not profile.ramp_s or not profile.distance:
            continue
        faster = plan_profile(profile.distance, profile.velocity, step_u_s2, parabolic=True)
        saved_s = profile.duration_s - faster.duration_s
        if saved_s < _WORTH_TELLING * profile.duration_s:
            continue
        leg = Leg(round(profile.distance), profile.velocity, step_u_s2, True, 1.0)
        ((margin, slips),) = emulated(plant, (leg,))
        if not slips and margin >= KEPT_MARGIN:
            axis, value = move.axes[0], move.in_uu(step_u_s2) / 1000
            yield rule.at(
                move.span,
                f"this move takes {profile.duration_s:.3f} s; with `PARA{axis}+` and "
                f"`ACC{axis} {value:.3g}` it takes {saved_s:.3f} s less, at a margin of "
                f"{margin:.0%}",
            )


def _comment_disagrees(rule: Rule, subject: Subject) -> Iterator[Finding]:
    from mopro.lint.comments import beside, claims

    units: dict[int, Fraction] = {}
    comments = {s.span: c for s, c in beside(subject.tree)}
    for statement, op in zip(subject.tree.statements, subject.program.ops, strict=True):
        if isinstance(op, ir.SetUnits):
            units.update(dict.fromkeys(op.axes, op.microsteps_per_uu))
        comment = comments.get(statement.span)
        value = _in_si(subject, op, units) if comment else None
        if comment is None or value is None:
            continue
        said = claims(comment.text, type(statement))
        if said and not any(claim.agrees_with(value) for claim in said):
            yield rule.at(
                statement.span,
                f"the comment says {said[0].text}, the statement means "
                f"{_as_meant(subject, statement, value, units, op)}",
                "correct the one that is wrong",
            )


def _in_si(subject: Subject, op: ir.Op, units: dict[int, Fraction]) -> Fraction | None:
    """What a statement sets, in SI; None where it takes a unit that is not known."""
    if isinstance(op, ir.Dwell):
        return Fraction(op.milliseconds, 1000)
    if not isinstance(op, ir.SetVelocity | ir.SetAcceleration) or op.axes[0] not in units:
        return None
    value = op.velocity_uu_s if isinstance(op, ir.SetVelocity) else op.acceleration_uu_s2
    return value * subject.metres_per_uu(units[op.axes[0]])


def _as_meant(
    subject: Subject, statement: ast.Statement, value: Fraction, units: dict[int, Fraction], op: Any
) -> str:
    if isinstance(op, ir.Dwell):
        return f"{float(value):g} s"
    microsteps = units[op.axes[0]]
    per = "s²" if isinstance(op, ir.SetAcceleration) else "s"
    shown = float(value / subject.metres_per_uu(microsteps))
    return f"{shown:.6g} {subject.unit(microsteps)}/{per}"


def _physics(name: str, check: Any, severity: Severity = Severity.WARNING, **texts: Any) -> Rule:
    return Rule(name, Stage.PHYSICS, severity, check=check, **texts)


RULES = (
    _physics(
        "stall",
        _stall,
        Severity.ERROR,
        what="A move in which the motor loses its tooth.",
        why="An open-loop motor that slips is somewhere else from then on, and nobody tells the "
        "controller. Judged by the emulator where a bound from energy does not decide.",
        bad="UU012500/1\nVEL1 40.0\nACC1 1.5\nMRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL1 40.0\nACC1 0.6\nMRI1 15.0\nWX1\n",
    ),
    _physics(
        "low-margin",
        _low_margin,
        what="A move that leaves less of the pull-out force than the margin asked for, 20 %.",
        why="A little more load or friction than modelled, and the motor stalls.",
        bad="UU012500/1\nVEL1 40.0\nPARA1+\nACC1 0.85\nMRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL1 40.0\nPARA1+\nACC1 0.6\nMRI1 15.0\nWX1\n",
    ),
    _physics(
        "over-temperature",
        _over_temperature,
        what="A program that makes the motor hotter than it is rated for.",
        why="The windings age and the platen grows; the time until then is what an unattended "
        "run may last.",
        bad="UU012500/1\nVEL0 1.0\nACC0 0.2\n:B1\nMRI1 0.5\nWX1\nMRI1 -0.5\nWX1\nJUMP B1\n",
        good="UU012500/1\nVEL0 15.0\nACC0 0.2\n:B1\nMRI1 15.0\nWX1\nMRI1 -15.0\nWX1\nJUMP B1\n",
    ),
    _physics(
        "off-travel",
        _off_travel,
        what="Moves that reach further than the travel of their axis, wherever they start.",
        why="The motor runs into the end of the platen, or out of the range of the instrument "
        "whose travel is configured.",
        bad=_READY + "MRI1 46.0\nWX1\n",
        good=_READY + "MRI1 20.0\nWX1\n",
    ),
    _physics(
        "limit-switch",
        _limit_switch,
        what="A move past a limit switch, from where the motor is configured to start.",
        why="The controller then gives the program up. `start` in the configuration, or `--start`, "
        "says where an axis begins, from the middle of its travel; without it the operator is "
        "taken to place the motor where the moves fit. The example starts axis 1 at 10 in.",
        bad=_READY + "MRI1 15.0\nWX1\n",
        good=_READY + "MRI1 12.0\nWX1\n",
        example=Settings(start_m={1: 0.254}),
    ),
    _physics(
        "slower-than-needed",
        _slower_than_needed,
        Severity.NOTE,
        what="A move that parabolic ramps would make more than a tenth shorter, at a margin of "
        "30 %.",
        why="Only a proposal, so it is asked by name. The parabolic ramp is let start at a higher "
        "acceleration, since it ends without a jolt.",
        bad=_READY + "MRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL0 40.0\nACC0 0.6\nPARA0+\nMRI1 15.0\nWX1\n",
        default=False,
    ),
    _physics(
        "comment-disagrees",
        _comment_disagrees,
        what="A comment that gives a velocity, acceleration or time other than the statement's.",
        why="One of the two is wrong. An acceleration is per second and per millisecond, which "
        "is easily forgotten.",
        bad="UU012500/1\nACC1 250.0 ; 250 in/s^2\n",
        good="UU012500/1\nACC1 0.25 ; 250 in/s^2\n",
    ),
)
