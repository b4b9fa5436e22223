"""Checks that a run can be simulated: its length, its limit switches, and no stall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mopro.effects import Active, catalogue_of
from mopro.effects.resolve import active_effects
from mopro.errors import Diagnostic, MotionError
from mopro.experiment.sawyer.trials import Reading, Trial
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.plant import limit_trip, plan_with_effects, simulate, switches_u
from mopro.program import AXES
from mopro.recording import MoveReport, Run
from mopro.recording.run import stall_findings

# What follows the motion is simulated sample by sample; what is slow may last for days.
LONGEST_S = 1800.0
# Relative: a logger's clock may run fast by this much.
_CLOCK_TOLERANCE = 0.01
_STALL_RATE_HZ = 100.0


@dataclass(frozen=True)
class Suspect:
    """A run and the schedule of its commanded motion."""

    trial: Trial
    schedule: Schedule

    def positions(self) -> Iterator[Reading]:
        return (r for r in self.trial.readings if r.sensor.quantity.sees_place)

    @property
    def commanded_by(self) -> str:
        program = self.trial.program
        return "its logged command" if program is None else program.name


def too_long(trials: Sequence[Trial]) -> Iterator[Diagnostic]:
    """Runs that would take too long to simulate."""
    for trial in trials:
        if trial.follows_motion and trial.duration_s > LONGEST_S:
            quantities = {r.sensor.quantity for r in trial.readings}
            moving = " and ".join(sorted(q.plural for q in quantities if q.follows_motion))
            message = f"{trial.name} has {trial.duration_s:.6g} s of {moving}"
            hint = f"expected at most {LONGEST_S:g} s: cut them, and say partial = true"
            yield Diagnostic("data-too-long", message, trial.span, hint=hint)


def too_short(suspects: Sequence[Suspect], machine: Machine) -> Iterator[Diagnostic]:
    """Runs whose data end before their program can have ended."""
    for suspect in suspects:
        trial = suspect.trial
        if trial.program is None or trial.partial or trial.program.loops_forever:
            continue
        interval_s = max(float(r.time_s[-1] - r.time_s[-2]) for r in trial.readings)
        needed_s = _shortest_s(trial, machine) * (1 - _CLOCK_TOLERANCE) - 2 * interval_s
        if trial.duration_s < needed_s:
            message = (
                f"{trial.name} ends after {trial.duration_s:.6g} s, and {trial.program.name}"
                f" takes {suspect.schedule.duration_s:.6g} s"
            )
            hint = "record the whole run, or say partial = true if it was cut on purpose"
            yield Diagnostic("data-too-short", message, trial.span, hint=hint)


def _shortest_s(trial: Trial, machine: Machine) -> float:
    """Least duration (s) of the program, with every effect that makes it faster at its bound."""
    assert trial.program is not None, "a logged command has no program"
    effects = catalogue_of(machine).values()
    faster = (Active(e, values, AXES) for e in effects if (values := e.fastest()) is not None)
    own = active_effects(machine, catalogue_of(machine), trial.data)
    return plan_with_effects(trial.program, machine, (*own, *faster)).duration_s


def check_motion(suspect: Suspect, machine: Machine, compiled: bool) -> None:
    """MotionError for a program that runs into a limit switch, or stalls, when simulated."""
    trial, schedule = suspect.trial, suspect.schedule
    if trial.program is None:
        return
    trip = limit_trip(schedule, switches_u(schedule, machine.travel_u()))
    if trip is not None:
        span = next(op.span for op in trial.program.ops if op.span.line == trip.line)
        message = f"axis {trip.axis} runs into its limit switch at {trip.time_s:.3f} s"
        hint = f"{trial.name} cannot be compared with a run that its machine breaks off"
        raise MotionError(
            trial.program.source, [Diagnostic("limit-switch", message, span, hint=hint)]
        )
    if not trial.follows_motion:
        return
    hint = f"{trial.name} cannot be compared: the motion of a stalled motor is not predictable"
    run = _simulated(trial, schedule, machine, compiled)
    stalled = [
        Diagnostic("stall", f"when simulated, {message}", span, hint=hint)
        for span, message, _ in stall_findings(run, trial.program)
    ]
    if stalled:
        raise MotionError(trial.program.source, stalled)


def _simulated(trial: Trial, schedule: Schedule, machine: Machine, compiled: bool) -> Run:
    """Simulate the run on the machine of its file up to the end of its data; report each move."""
    simulation = simulate(schedule, machine, payload_kg=trial.payload_kg, compiled=compiled)
    end_s = min(schedule.duration_s, trial.duration_s)
    simulation.follow(_STALL_RATE_HZ, end_s)
    simulation.settle()
    moves = (m for m in schedule.moves if m.start_s < end_s)
    return Run(
        program=schedule.program.name,
        machine=machine.name,
        duration_s=end_s,
        loops_forever=schedule.program.loops_forever,
        complete=True,
        moves=tuple(MoveReport.of(m, simulation.outcome(m), machine.microstep_m) for m in moves),
    )
