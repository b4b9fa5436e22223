"""Checks that each run's data belong to its program: swapped runs, wrong axis, unit or sign.

Data are compared with the command, not with a simulation: a machine that lags, loses
pitches or moves at the wrong speed still follows its own program far better than another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations

import numpy as np

from mopro.errors import Diagnostic, ModelError
from mopro.experiment.range_ends import end_notes
from mopro.experiment.sawyer.feasible import Suspect, check_motion, too_long, too_short
from mopro.experiment.sawyer.nominal import compiling_pays, planned
from mopro.experiment.sawyer.trials import Experiment, Floats, Reading
from mopro.experiment.steps import step_note
from mopro.instruments.sensor import FOLD_SLIPS, Sensor
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.plant import CommandTable
from mopro.program import AXES
from mopro.units import UNITS

# Another command fits far better if its RMS misfit is smaller by this factor.
FAR_BETTER = 5.0
# Relative: no two units of length are closer than 1 : 2.5, no velocity scale is off by more.
_UNIT_TOLERANCE = 0.05
# A command with less than this share of the data's standard deviation is at rest beside them.
_LEAST_MOTION_SHARE = 0.2
# Share of the data's variance that the scaled command must explain before a unit is blamed.
_EXPLAINED_SHARE = 0.9
# Squared correlation with the command below which a note is given.
_FOLLOWING_SHARE = 0.5
_LENGTHS = ("in", "mm", "um", "m", "cm")


def check(experiment: Experiment) -> list[str]:
    """Refuse data that do not belong to the program of their run; return notes on odd data.

    Raises ModelError at the runs of the experiment file, or MotionError at the line of a
    program that the machine cannot follow.
    """
    endless = list(too_long(experiment.trials))
    if endless:
        raise ModelError(experiment.source, endless)
    suspects = [Suspect(trial, planned(trial, experiment.machine)) for trial in experiment.trials]
    machine = experiment.machine
    # In this order: a swapped run would also be reported as a wrong axis, unit or length.
    for find_faults in (_swapped, _wrong_axes, _wrong_units, too_short):
        faults = list(find_faults(suspects, machine))
        if faults:
            raise ModelError(experiment.source, faults)
    compiled = compiling_pays(experiment)
    for suspect in suspects:
        check_motion(suspect, machine, compiled)
    return [*_unlikely(suspects, machine), *_unstated_steps(suspects), *_ends(suspects, machine)]


def _unstated_steps(suspects: Sequence[Suspect]) -> list[str]:
    """Notes on sensors whose readings have a step that is not stated, each once."""
    notes: dict[str, str] = {}
    for suspect in suspects:
        for reading in suspect.positions():
            own = reading.sensor
            note = step_note(own.name, own.unit, reading.values, own.adc_step, own.noise_rms)
            if note is not None:
                notes.setdefault(own.name, note)
    return [*notes.values()]


def _ends(suspects: Sequence[Suspect], machine: Machine) -> Iterator[str]:
    """Notes on positions that stay where the command goes on."""
    for suspect in suspects:
        for reading in suspect.positions():
            own, time_s = reading.sensor, reading.time_s
            command = partial(_command_m, suspect.schedule, own.axis, time_s, machine)
            where = f"{suspect.trial.name}, {own.name}"
            yield from end_notes(where, own.unit, time_s, reading.values, command)


def _command_m(schedule: Schedule, axis: int, time_s: Floats, machine: Machine) -> Floats:
    command: Floats = CommandTable(schedule.tracks[axis]).position_u(time_s) * machine.microstep_m
    return command


def _misfit_m(reading: Reading, command_m: Floats) -> float:
    """RMS difference from the command (m), less its mean and the sensor's noise variance.

    At least √2 times the standard error of that variance, as noise leaves it uncertain.
    """
    sensor = reading.sensor
    difference_m = reading.values * sensor.unit_si - command_m
    sigma_m = sensor.sigma * sensor.unit_si
    excess = float(np.var(difference_m)) - sigma_m**2
    return math.sqrt(max(excess, 2 * sigma_m**2 * math.sqrt(2 / len(difference_m))))


# -- two runs exchanged ----------------------------------------------------------


def _swapped(suspects: Sequence[Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for one, other in combinations(suspects, 2):
        if _far_better(one, other, machine) and _far_better(other, one, machine):
            names = one.trial.name, other.trial.name
            message = (
                f"two runs seem to be swapped: {names[0]} fits {other.commanded_by} far better"
                f" than {one.commanded_by}, and {names[1]} the other way round"
            )
            hint = "exchange their programs, or their data"
            yield Diagnostic("swapped", message, one.trial.span, hint=hint)


def _far_better(one: Suspect, other: Suspect, machine: Machine) -> bool:
    """True if every position of `one` follows the motion of `other` and not its own."""
    ratios = []
    for reading in one.positions():
        own, alternative = (
            _command_m(s.schedule, reading.sensor.axis, reading.time_s, machine)
            for s in (one, other)
        )
        if np.ptp(alternative) or np.ptp(own):
            moved = _moves_enough(reading, alternative)
            ratio = _misfit_m(reading, own) / _misfit_m(reading, alternative)
            ratios.append(ratio if moved else 0.0)
    return bool(ratios) and min(ratios) > FAR_BETTER


def _moves_enough(reading: Reading, command_m: Floats) -> bool:
    """True if a command moves about as much as the data; data at rest fit any command at rest."""
    spread_m = float(np.std(reading.values)) * reading.sensor.unit_si
    return float(np.std(command_m)) > _LEAST_MOTION_SHARE * spread_m


# -- the other axis, another unit --------------------------------------------------


def _wrong_axes(suspects: Sequence[Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for suspect in suspects:
        for reading in suspect.positions():
            axis = reading.sensor.axis
            other = next(n for n in AXES if n != axis)
            own, alternative = (
                _command_m(suspect.schedule, n, reading.time_s, machine) for n in (axis, other)
            )
            if not _moves_enough(reading, alternative):
                continue
            if _misfit_m(reading, own) > FAR_BETTER * _misfit_m(reading, alternative):
                message = (
                    f"{suspect.trial.name}: {reading.sensor.column} follows the command of axis"
                    f" {other}, and sensor {reading.sensor.name} is said to be on axis {axis}"
                )
                hint = "correct the sensor's axis and column, or the data"
                yield Diagnostic("wrong-axis", message, suspect.trial.span, hint=hint)


def _wrong_units(suspects: Sequence[Suspect], machine: Machine) -> Iterator[Diagnostic]:
    for suspect in suspects:
        for reading in suspect.positions():
            command_m = _command_m(suspect.schedule, reading.sensor.axis, reading.time_s, machine)
            scale = _scale_of(reading, command_m)
            if scale is not None:
                yield from _scale_finding(suspect, reading.sensor, scale)


def _scale_of(reading: Reading, command_m: Floats) -> float | None:
    """Ratio of the data to the command by least squares; None where they do not follow it."""
    if not np.ptp(command_m):
        return None
    values_m = (reading.values - reading.values.mean()) * reading.sensor.unit_si
    command = command_m - command_m.mean()
    scale = float(values_m @ command) / float(command @ command)
    sigma_m = reading.sensor.sigma * reading.sensor.unit_si
    explained = scale**2 * float(np.var(command))
    residual = max(float(np.var(values_m)) - explained - sigma_m**2, 0.0)
    error = sigma_m / math.sqrt(float(command @ command))
    precise = error < _UNIT_TOLERANCE * abs(scale)
    return scale if precise and residual < (1 / _EXPLAINED_SHARE - 1) * explained else None


def _scale_finding(suspect: Suspect, sensor: Sensor, scale: float) -> Iterator[Diagnostic]:
    unit = sensor.unit
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
    for factor, slip in FOLD_SLIPS.items():
        if abs(abs(scale) / factor - 1) < _UNIT_TOLERANCE:
            hint = "correct the scale of the instrument, and convert the data"
            message = f"{here} {what}: {slip}?"
            yield Diagnostic("wrong-scale", message, suspect.trial.span, hint=hint)


def _unlikely(suspects: Sequence[Suspect], machine: Machine) -> Iterator[str]:
    """Notes on data that correlate poorly with their command: perhaps the wrong column or run."""
    for suspect in suspects:
        for reading in suspect.positions():
            command_m = _command_m(suspect.schedule, reading.sensor.axis, reading.time_s, machine)
            sigma_m = reading.sensor.sigma * reading.sensor.unit_si
            if (
                float(np.std(command_m)) > sigma_m
                and _r_squared(reading.values, command_m) < _FOLLOWING_SHARE
            ):
                yield (
                    f"{suspect.trial.name}: {reading.sensor.column} hardly follows"
                    f" {suspect.commanded_by}: is it the right column, and the right run?"
                )


def _r_squared(values: Floats, command: Floats) -> float:
    """Squared correlation of data and command; 0 for data at rest."""
    if not np.ptp(values):
        return 0.0
    return float(np.corrcoef(values, command)[0, 1]) ** 2
