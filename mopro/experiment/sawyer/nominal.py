"""Predictions of an experiment's readings by the machine of its file, without added effects."""

from __future__ import annotations

import numpy as np

from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.logged import schedule_of
from mopro.experiment.sawyer.steady import rises
from mopro.experiment.sawyer.trials import Experiment, Floats, SteadyTable, Trial
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.plant import COMPILE_FROM_STEPS, MAX_STEP_S, Stepping, plan_with_effects
from mopro.program import AXES


def predict(experiment: Experiment) -> list[list[Floats]]:
    """Noiseless values of each reading of each trial, in the unit of its sensor.

    The drive is simulated with and without microsteps; the better fit is returned.
    """
    drives = [
        _by_trial(experiment, ForwardModel(experiment, Stepping(MAX_STEP_S), resolved)({}))
        for resolved in (False, True)
    ]
    return min(drives, key=lambda predicted: _chi2(experiment, predicted))


def predict_table(table: SteadyTable, machine: Machine) -> Floats:
    """The rise (K) of each row of a table."""
    return rises(table, machine, {})


def planned(trial: Trial, machine: Machine) -> Schedule:
    """Schedule of the trial's commanded motion; an endless program lasts as long as the data."""
    if trial.program is None:
        assert trial.command is not None, "a trial has a program or a logged command"
        return schedule_of(trial.command, machine)
    endless = trial.program.loops_forever or trial.partial
    for_s = trial.duration_s if endless else None
    active = active_effects(machine, catalogue_of(machine), trial.data)
    return plan_with_effects(trial.program, machine, active, for_s)


def compiling_pays(experiment: Experiment) -> bool:
    """True if compiling the kernel takes less time than it saves over all runs."""
    moved_s = sum(trial.duration_s for trial in experiment.trials if trial.follows_motion)
    return moved_s * len(AXES) / MAX_STEP_S >= COMPILE_FROM_STEPS


def _by_trial(experiment: Experiment, predicted: list[Floats]) -> list[list[Floats]]:
    values = iter(predicted)
    return [[next(values) for _ in trial.readings] for trial in experiment.trials]


def _chi2(experiment: Experiment, predicted: list[list[Floats]]) -> float:
    """Chi-squared of all readings without their offsets."""
    return sum(
        float(np.sum((aligned(reading.values - expected) / reading.sensor.sigma) ** 2))
        for trial, of_trial in zip(experiment.trials, predicted, strict=True)
        for reading, expected in zip(trial.readings, of_trial, strict=True)
    )


def aligned(residual: Floats) -> Floats:
    """`residual` less its offset, a robust mean.

    The offset is the mean of the samples within 3 σ of the median, σ from the median absolute
    deviation, so that a disagreement in a few places does not shift all others.
    """
    middle = float(np.median(residual))
    spread = 1.4826 * float(np.median(np.abs(residual - middle)))
    near = np.abs(residual - middle) <= 3 * spread
    return residual - float(residual[near].mean())
