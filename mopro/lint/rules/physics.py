"""Rules that simulate the machine with its payload."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from mopro.errors import Severity
from mopro.lint.rule import Finding, Rule, Stage, Subject
from mopro.motion import PlannedMove, Survey, plan_profile
from mopro.motion.profile import per_millisecond
from mopro.program import AXES
from mopro.source import Span

if TYPE_CHECKING:
    from mopro.machine import Machine


_READY = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
# Least margin (share of the pull-out force) of an acceleration that is proposed.
SAFE_MARGIN = 0.05
# Least margin of a faster profile, and the share of the move's time that it must save.
FASTER_MARGIN = 0.30
_LEAST_SAVING = 0.10
_MOST_PROPOSALS = 10
_MINUTE_S = 60.0


def _acceleration(subject: Subject, move: PlannedMove) -> tuple[float, str]:
    """The acceleration of a move in user units per second squared, and its unit."""
    unit = subject.unit(move.microsteps_per_uu)
    return move.in_uu(move.profile.acceleration), f"{unit}/s²"


def _stall(rule: Rule, subject: Subject) -> Iterator[Finding]:
    reported: set[Span] = set()
    for checked in subject.stall_margins.each:
        span = checked.move.span
        if not checked.slips or span in reported:
            continue
        reported.add(span)
        value, unit = _acceleration(subject, checked.move)
        message = f"axis {checked.axis} stalls in this move at {value:.4g} {unit}: margin 0 %"
        hint = (
            _what_works(subject, checked, value, unit) if len(reported) <= _MOST_PROPOSALS else None
        )
        yield rule.at(span, message, hint)
    unchecked = sorted({move.span for move in subject.stall_margins.unchecked})
    if unchecked:
        message = (
            f"from here on {len(unchecked)} statements with moves are not checked for stall: they "
            "differ too much to be emulated here"
        )
        yield rule.at(unchecked[0], message, "see `mopro run --emulate`")


def _what_works(subject: Subject, stalled: Any, value: float, unit: str) -> str:
    from mopro.lint.stall_margins import largest_acceleration

    velocity = stalled.move.in_uu(stalled.move.profile.velocity)
    axis = stalled.move.axes[0]
    slip = per_millisecond(value, velocity, axis, unit.removesuffix("/s²"))
    if slip is not None:
        return slip
    best = largest_acceleration(subject.stall_margins.laden, stalled, value, SAFE_MARGIN)
    if best is None:
        return f"no acceleration from a hundredth of {value:.4g} {unit} on works"
    works, margin = best
    return (
        f"the largest acceleration that works is {works:g} {unit}, `ACC{axis} {works / 1000:g}`, "
        f"with a margin of {margin:.0%}"
    )


def _low_margin(rule: Rule, subject: Subject) -> Iterator[Finding]:
    least: dict[Span, Any] = {}
    stalled = {checked.move.span for checked in subject.stall_margins.each if checked.slips}
    for checked in subject.stall_margins.each:
        span = checked.move.span
        if checked.margin < subject.settings.low_margin and span not in stalled:
            least[span] = min(least.get(span, checked), checked, key=lambda s: s.margin)
    for span, checked in least.items():
        yield rule.at(
            span,
            f"axis {checked.axis} has a margin of {checked.margin:.0%} against stall in this move: "
            f"less than {subject.settings.low_margin:.0%}",
            "lower the acceleration or the payload",
        )


def _over_temperature(rule: Rule, subject: Subject) -> Iterator[Finding]:

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


def _slower_than_needed(rule: Rule, subject: Subject) -> Iterator[Finding]:
    from mopro.lint.energy_bound import greatest_step_m_s2
    from mopro.lint.rules.motion import first_by_span
    from mopro.lint.stall_margins import Emulations, MoveOnAxis

    laden = subject.stall_margins.laden
    emulations = Emulations(laden)
    unseen: list[Span] = []
    step_u_s2 = greatest_step_m_s2(laden.pendulum.pull_out_m_s2, FASTER_MARGIN)
    step_u_s2 /= subject.machine.microstep_m
    for move in first_by_span(subject.distinct_moves):
        profile = move.profile
        if not profile.ramp_s or not profile.distance:
            continue
        faster = plan_profile(profile.distance, profile.velocity, step_u_s2, parabolic=True)
        saved_s = profile.duration_s - faster.duration_s
        if saved_s < _LEAST_SAVING * profile.duration_s:
            continue
        motion = MoveOnAxis(round(profile.distance), profile.velocity, step_u_s2, True, 1.0)
        outcomes = emulations.of((motion,), faster.duration_s + motion.rest_s)
        if outcomes is None:
            unseen.append(move.span)
            continue
        ((margin, slips),) = outcomes
        if not slips and margin >= FASTER_MARGIN:
            axis, value = move.axes[0], move.in_uu(step_u_s2) / 1000
            yield rule.at(
                move.span,
                f"this move takes {profile.duration_s:.3f} s; with `PARA{axis}+` and "
                f"`ACC{axis} {value:.3g}` it takes {saved_s:.3f} s less, at a margin of "
                f"{margin:.0%}",
            )
    if unseen:
        message = (
            f"from here on {len(unseen)} statements with moves are not tried with parabolic ramps: "
            "they differ too much to be emulated here"
        )
        yield rule.at(unseen[0], message, "see `mopro optimize`")


def _physics(name: str, check: Any, severity: Severity = Severity.WARNING, **texts: Any) -> Rule:
    return Rule(name, Stage.PHYSICS, severity, check=check, **texts)


RULES = (
    _physics(
        "stall",
        _stall,
        Severity.ERROR,
        what="A move in which the motor loses its tooth.",
        why="An open-loop motor that slips has lost its position, and the controller does not "
        "notice. Decided by the emulator where an energy bound is not sufficient.",
        bad="UU012500/1\nVEL1 40.0\nACC1 1.5\nMRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL1 40.0\nACC1 0.6\nMRI1 15.0\nWX1\n",
    ),
    _physics(
        "low-margin",
        _low_margin,
        what="A move that leaves less of the pull-out force than the required margin, 20 %.",
        why="With a little more load or friction than modelled, the motor stalls.",
        bad="UU012500/1\nVEL1 40.0\nPARA1+\nACC1 0.85\nMRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL1 40.0\nPARA1+\nACC1 0.6\nMRI1 15.0\nWX1\n",
    ),
    _physics(
        "over-temperature",
        _over_temperature,
        what="A program that makes the motor hotter than it is rated for.",
        why="The windings age and the platen expands; an unattended run must end before that time.",
        bad="UU012500/1\nVEL0 1.0\nACC0 0.2\n:B1\nMRI1 0.5\nWX1\nMRI1 -0.5\nWX1\nJUMP B1\n",
        good="UU012500/1\nVEL0 15.0\nACC0 0.2\n:B1\nMRI1 15.0\nWX1\nMRI1 -15.0\nWX1\nJUMP B1\n",
    ),
    _physics(
        "slower-than-needed",
        _slower_than_needed,
        Severity.NOTE,
        what="A move that parabolic ramps would make more than a tenth shorter, at a margin of "
        "30 %.",
        why="Only a proposal, so it must be selected by name. The parabolic ramp may start at a "
        "higher acceleration, as it ends without a step of acceleration.",
        bad=_READY + "MRI1 15.0\nWX1\n",
        good="UU012500/1\nVEL0 40.0\nACC0 0.6\nPARA0+\nMRI1 15.0\nWX1\n",
        default=False,
    ),
)


# -- overheating ------------------------------------------------------------------------------
# Finds the time at which a program heats the motor above its rated temperature.

_COIL_PAIRS = 4


class Overheating(NamedTuple):
    """The motor passes its rating after `after_s`, and would reach `final_C` (°C)."""

    after_s: float
    final_C: float
    span: Span


def can_overheat(machine: Machine, duration_s: float) -> bool:
    """True if the heat of `duration_s` (s) would suffice without any loss."""
    heat, drive = machine.heat, machine.drive
    squares = _COIL_PAIRS * drive.phase_current_A**2 + len(AXES) * heat.moving_current_A**2
    energy_J = squares * drive.coil_resistance_ohm * duration_s
    capacity_J_K = machine.axis.moving_mass_kg * heat.specific_heat_J_kg_K
    return energy_J / capacity_J_K > heat.rated_C - heat.ambient_C


def overheating(machine: Machine, survey: Survey, loops: bool) -> Overheating | None:
    """The first time at which the temperature passes the rating, or None if it never does."""
    import numpy as np

    from mopro.plant import simulate

    moves = survey.schedule.moves
    if not moves:
        return None
    simulation = simulate(survey.schedule, machine, active=())
    ends_s = np.array([move.end_s for move in moves])
    above = np.flatnonzero(simulation.temperature_C(ends_s) > machine.heat.rated_C)
    if len(above):
        hot = moves[int(above[0])]
        return Overheating(hot.end_s, float(simulation.temperature_C(ends_s).max()), hot.span)
    if not loops or len(survey.laps) < 3:
        return None
    laps_s = np.array([lap.time_s for lap in survey.laps[-3:]])
    return _in_the_long_run(
        machine, laps_s.tolist(), simulation.temperature_C(laps_s).tolist(), moves
    )


def _in_the_long_run(
    machine: Machine, laps_s: list[float], laps_C: list[float], moves: tuple[PlannedMove, ...]
) -> Overheating | None:
    """Extrapolate the temperatures of three laps, which approach the final one geometrically."""
    first, second, third = laps_C
    if second == first or third == second:
        return None
    ratio = (third - second) / (second - first)
    if not 0 < ratio < 1:
        return None
    final_C = third + (third - second) * ratio / (1 - ratio)
    rated_C = machine.heat.rated_C
    if final_C <= rated_C:
        return None
    rounds = math.log((final_C - rated_C) / (final_C - third)) / math.log(ratio)
    after_s = laps_s[2] + rounds * (laps_s[2] - laps_s[1])
    return Overheating(after_s, final_C, moves[-1].span)
