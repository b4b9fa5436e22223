"""An experiment through the diagnosis: model, candidates and data joined, the answer rounded off."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from mopro.diagnosis import Estimate, Named, Series, Settings, Verdict, reconcile
from mopro.experiment.catalogue import candidates
from mopro.experiment.model import Experiment, Floats
from mopro.experiment.motor import COARSE_STEP_S, FINE_STEP_S, Motor
from mopro.experiment import thermal
from mopro.experiment.series import series_of
from mopro.experiment.steady import rises

OFFSET = "sensor_offset"
# An offset this many standard deviations clear of zero, and the same in all runs, is one.
_CLEARLY = 6.0
_THE_SAME = 1e-3
_FEWEST_RUNS = 2


class Model:
    """Everything that an experiment measured, as effects would have it."""

    def __init__(self, experiment: Experiment, max_step_s: float = COARSE_STEP_S) -> None:
        self.experiment = experiment
        self.motor = Motor(experiment, max_step_s)

    def __call__(self, settings: Settings) -> list[Floats]:
        machine = self.experiment.machine
        tables = [rises(table, machine, settings) for table in self.experiment.tables]
        return [*self.motor(settings), *tables]

    def series(self) -> list[Series]:
        return [*series_of(self.motor), *map(thermal.series, self.experiment.tables)]


def diagnose(
    experiment: Experiment, jobs: int = 1, progress: Callable[[str], None] = lambda _: None
) -> Verdict:
    """What the machine's model lacks that the experiment's data show.

    Raises MotionError for a program that cannot be run.
    """
    model = Model(experiment)
    data = model.series()
    verdict = reconcile(
        model,
        candidates(model.motor),
        data,
        finer=Model(experiment, FINE_STEP_S),
        jobs=jobs,
        progress=progress,
    )
    return _with_offset(verdict, data, model({})) if verdict.verdict == "none" else verdict


def _with_offset(verdict: Verdict, data: Sequence[Series], predicted: Sequence[Floats]) -> Verdict:
    """`verdict` with an offset that all runs share, if that is all there is to find."""
    for sensor in dict.fromkeys(s.sensor for s in data):
        rows = [i for i, s in enumerate(data) if s.sensor == sensor and s.sigma]
        found = _common_offset([data[i] for i in rows], [predicted[i] for i in rows])
        if found is not None:
            return replace(verdict, verdict="named", effects=(found,))
    return verdict


def _common_offset(data: Sequence[Series], predicted: Sequence[Floats]) -> Named | None:
    """The offset of one sensor; where a run stood at its start is no offset."""
    if len(data) < _FEWEST_RUNS:
        return None
    means = np.array([np.mean(s.values - p) for s, p in zip(data, predicted, strict=True)])
    errors = np.array([(s.sigma or 0.0) / math.sqrt(len(s)) for s in data])
    weights = 1 / errors**2
    offset, error = float(means @ weights / weights.sum()), 1 / math.sqrt(weights.sum())
    scatter = float(((means - offset) ** 2) @ weights)
    if abs(offset) < _CLEARLY * error or stats.chi2.sf(scatter, len(data) - 1) < _THE_SAME:
        return None
    sigmas = abs(offset) / error
    interval = (offset - 1.96 * error, offset + 1.96 * error)
    return Named(
        name=OFFSET,
        form="",
        parameters={"o": Estimate(offset, data[0].unit, interval, False)},
        indistinguishable_from=[],
        rivals={},
        log10_bayes_factor=(sigmas**2 - math.log(sum(map(len, data)))) / (2 * math.log(10)),
        sigmas=sigmas,
        held_out=True,
    )
