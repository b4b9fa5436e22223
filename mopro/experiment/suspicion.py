"""Whether data and programs belong together: what no effect of a machine could explain.

Data are held against what the programs command, not against a simulation. A machine that
lags, loses pitches, or moves at another speed than it is told still follows its own
program far better than any other one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mopro.emulator import Emulator
from mopro.emulator.command import CommandTable
from mopro.emulator.effects import Active, catalogue
from mopro.emulator.measured import POSITION, Sensor
from mopro.emulator.setup import planned as planned_with
from mopro.emulator.trips import limit_trip, switches_u
from mopro.errors import Diagnostic, ModelError, MotionError
from mopro.experiment.model import Experiment, Floats, Reading, Trial
from mopro.experiment.nominal import planned
from mopro.machine import Machine
from mopro.machine.report import move_report
from mopro.motion import Schedule
from mopro.program import AXES
from mopro.recording import Run
from mopro.recording.table import stalls
from mopro.units import UNITS

# Another program (axis, unit) fits far better: its misfit is smaller by this factor.
FAR_BETTER = 5.0
# The fastest that the catalogue's plausible effects make a program.
_FASTEST = {"acceleration_scale": 0.5, "velocity_scale": 0.02}
_CLOCK_TOLERANCE = 0.01
_UNIT_TOLERANCE = 0.05
_MOVES_SHARE = 0.2
_EXPLAINED = 0.9
_STALL_RATE_HZ = 100.0
_LENGTHS = ("in", "mm", "um", "m", "cm")


def check(experiment: Experiment) -> None:
    """Refuse data that cannot have come from the runs that they are said to be of.

    Raises ModelError at the runs of the experiment file, or MotionError at the line of a
    program that the machine cannot follow.
    """
    suspects = [_Suspect(trial, planned(trial, experiment.machine)) for trial in experiment.trials]
    machine = experiment.machine
    # The first that finds something explains what the later ones would find.
    for look in (_swapped, _wrong_axes, _wrong_units, _too_short):
        found = list(look(suspects, machine))
        if found:
            raise ModelError(experiment.source, found)
    for suspect in suspects:
        _check_motion(suspect, machine)


@dataclass(frozen=True)
class _Suspect:
    trial: Trial
    schedule: Schedule

    def positions(self) -> Iterator[Reading]:
        return (r for r in self.trial.readings if r.sensor.quantity == POSITION)

    @property
    def commanded_by(self) -> str:
        program = self.trial.program
        return "its logged command" if program is None else program.name


def _command_m(schedule: Schedule, axis: int, time_s: Floats, machine: Machine) -> Floats:
    command: Floats = CommandTable(schedule.tracks[axis]).position_u(time_s) * machine.microstep_m
    return command


def _misfit_m(reading: Reading, command_m: Floats) -> float:
    """RMS distance from the command, an offset and the sensor's noise taken out (m).

    Never below what the noise leaves uncertain.
    """
    sensor = reading.sensor
    apart = reading.values * sensor.unit_si - command_m
    sigma_m = sensor.sigma * sensor.unit_si
    excess = float(np.var(apart)) - sigma_m**2
    return math.sqrt(max(excess, 2 * sigma_m**2 * math.sqrt(2 / len(apart))))


# -- two runs exchanged ----------------------------------------------------------


def _swapped(suspects: Sequence[_Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for one, other in combinations(suspects, 2):
        if _far_better(one, other, machine) and _far_better(other, one, machine):
            names = one.trial.name, other.trial.name
            message = (
                f"two runs seem to be swapped: {names[0]} fits {other.commanded_by} far better"
                f" than {one.commanded_by}, and {names[1]} the other way round"
            )
            hint = "exchange their programs, or their data"
            yield Diagnostic("swapped", message, one.trial.span, hint=hint)


def _far_better(one: _Suspect, other: _Suspect, machine: Machine) -> bool:
    """Whether all data of `one` follow the motion of `other` and not its own."""
    ratios = []
    for reading in one.positions():
        own, strange = (
            _command_m(s.schedule, reading.sensor.axis, reading.time_s, machine)
            for s in (one, other)
        )
        if np.ptp(strange) or np.ptp(own):
            moved = _moves_enough(reading, strange)
            ratio = _misfit_m(reading, own) / _misfit_m(reading, strange)
            ratios.append(ratio if moved else 0.0)
    return bool(ratios) and min(ratios) > FAR_BETTER


def _moves_enough(reading: Reading, command_m: Floats) -> bool:
    """Whether a command moves about as much as the data; data at rest fit any rest."""
    spread_m = float(np.std(reading.values)) * reading.sensor.unit_si
    return float(np.std(command_m)) > _MOVES_SHARE * spread_m


# -- the other axis, another unit --------------------------------------------------


def _wrong_axes(suspects: Sequence[_Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for suspect in suspects:
        for reading in suspect.positions():
            axis = reading.sensor.axis
            other = next(n for n in AXES if n != axis)
            own, strange = (
                _command_m(suspect.schedule, n, reading.time_s, machine) for n in (axis, other)
            )
            if not _moves_enough(reading, strange):
                continue
            if _misfit_m(reading, own) > FAR_BETTER * _misfit_m(reading, strange):
                message = (
                    f"{suspect.trial.name}: {reading.sensor.column} follows the command of axis"
                    f" {other}, and sensor {reading.sensor.name} is said to be on axis {axis}"
                )
                hint = "correct the sensor's axis and column, or the data"
                yield Diagnostic("wrong-axis", message, suspect.trial.span, hint=hint)


def _wrong_units(suspects: Sequence[_Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for suspect in suspects:
        for reading in suspect.positions():
            command_m = _command_m(suspect.schedule, reading.sensor.axis, reading.time_s, machine)
            found = _scale_of(reading, command_m)
            if found is not None:
                yield from _scale_finding(suspect, reading.sensor, found)


def _scale_of(reading: Reading, command_m: Floats) -> float | None:
    """How many times as large as commanded the data are, if they follow the command.

    None where the fit is too poor to tell.
    """
    if not np.ptp(command_m):
        return None
    values_m = (reading.values - reading.values.mean()) * reading.sensor.unit_si
    command = command_m - command_m.mean()
    scale = float(values_m @ command) / float(command @ command)
    sigma_m = reading.sensor.sigma * reading.sensor.unit_si
    explained = scale**2 * float(np.var(command))
    left = max(float(np.var(values_m)) - explained - sigma_m**2, 0.0)
    uncertain = sigma_m / math.sqrt(float(command @ command))
    clear = uncertain < _UNIT_TOLERANCE * abs(scale) and left < (1 / _EXPLAINED - 1) * explained
    return scale if clear else None


def _scale_finding(suspect: _Suspect, sensor: Sensor, scale: float) -> Iterator[Diagnostic]:
    unit = sensor.column.rsplit("_", 1)[-1]
    here = f"{suspect.trial.name}: {sensor.column}"
    what = f"goes {abs(scale):.4g} times as far as {suspect.commanded_by} commands"
    if abs(scale + 1) < _UNIT_TOLERANCE:
        hint = "correct the sign of the data: an offset is fitted, a direction is not"
        message = f"{here} goes the other way than {suspect.commanded_by} commands"
        yield Diagnostic("wrong-sign", message, suspect.trial.span, hint=hint)
    for other in _LENGTHS:
        ratio = float(UNITS[unit][1] / UNITS[other][1])
        if other != unit and abs(abs(scale) / ratio - 1) < _UNIT_TOLERANCE:
            message = f"{here} {what}: the data seem to be in {other}, not in {unit}"
            hint = "units are not guessed: name the column after its unit, or convert the data"
            yield Diagnostic("mixed-units", message, suspect.trial.span, hint=hint)


# -- programs and their time ---------------------------------------------------------


def _too_short(suspects: Sequence[_Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for suspect in suspects:
        trial = suspect.trial
        if trial.program is None or trial.partial or trial.program.loops_forever:
            continue
        interval_s = max(1 / reading.sensor.rate_hz for reading in trial.readings)
        needed_s = _shortest_s(trial, machine) * (1 - _CLOCK_TOLERANCE) - 2 * interval_s
        if trial.duration_s < needed_s:
            message = (
                f"{trial.name} ends after {trial.duration_s:.6g} s, and {trial.program.name}"
                f" takes {suspect.schedule.duration_s:.6g} s"
            )
            hint = "record the whole run, or say partial = true if it was cut on purpose"
            yield Diagnostic("data-too-short", message, trial.span, hint=hint)


def _shortest_s(trial: Trial, machine: Machine) -> float:
    """How long the program takes at least, on a machine that is faster than told."""
    assert trial.program is not None, "a logged command has no program"
    faster = tuple(Active(catalogue()[name], (e,), AXES) for name, e in _FASTEST.items())
    own = Emulator(machine, trial.payload_kg).active
    return planned_with(trial.program, machine, (*own, *faster), None).duration_s


def _check_motion(suspect: _Suspect, machine: Machine) -> None:
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
    if not any(suspect.positions()):
        return
    hint = f"{trial.name} cannot be compared: what a motor does that slips is chance"
    found = [
        Diagnostic("stall", f"when simulated, {message}", span, hint=hint)
        for span, message in stalls(_simulated(trial, schedule, machine), trial.program)
    ]
    if found:
        raise MotionError(trial.program.source, found)


def _simulated(trial: Trial, schedule: Schedule, machine: Machine) -> Run:
    """The moves of the run on the machine as its file has it, as far as the data go."""
    emulation = Emulator(machine, trial.payload_kg).begin(schedule)
    end_s = min(schedule.duration_s, trial.duration_s)
    emulation.advance(np.arange(0.0, end_s, 1 / _STALL_RATE_HZ), end_s)
    emulation.settle()
    moves = (m for m in schedule.moves if m.start_s < end_s)
    return Run(
        program=schedule.program.name,
        machine=machine.name,
        duration_s=end_s,
        loops_forever=schedule.program.loops_forever,
        complete=True,
        moves=tuple(move_report(m, emulation.outcome(m), machine.microstep_m) for m in moves),
    )
