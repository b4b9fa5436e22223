"""An experiment through the diagnosis: its model, its candidates and its data joined."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from mopro.diagnosis import Estimate, Named, Series, Settings, Verdict, reconcile
from mopro.diagnosis.residual import Residuals
from mopro.effects import Effect, catalogue
from mopro.experiment.diagnose import thermal
from mopro.experiment.diagnose.candidates import candidates
from mopro.experiment.diagnose.quantisation import thinned
from mopro.experiment.diagnose.series import series_of
from mopro.experiment.model import Experiment, Floats
from mopro.experiment.predict.forward_model import COARSE, FINE, ForwardModel
from mopro.experiment.predict.steady import rises
from mopro.instruments.sensor import Sensor
from mopro.machine import Machine
from mopro.plant import Stepping

# An offset this many standard deviations clear of zero, and the same in all runs, is one.
_CLEARLY = 6.0
_THE_SAME = 1e-3
_FEWEST_RUNS = 2
# What microsteps must take away in chi-squared before they are taken to show; where something is
# left unexplained, in units of its mean square, as anything takes away a little of that.
_STEPS_SHOW = 10.0


class Model:
    """Everything that an experiment measured, as effects would have it."""

    def __init__(
        self,
        experiment: Experiment,
        stepping: Stepping = COARSE,
        resolved: bool = False,
    ) -> None:
        self.experiment = experiment
        self.resolved = resolved
        self.motor = ForwardModel(experiment, stepping, resolved)

    def __call__(self, settings: Settings) -> list[Floats]:
        machine = self.experiment.machine
        tables = [rises(table, machine, settings) for table in self.experiment.tables]
        return [*self.motor(settings), *tables]

    def series(self) -> list[Series]:
        return [*series_of(self.motor), *map(thermal.series, self.experiment.tables)]


@dataclass(frozen=True)
class Diagnosis:
    """The verdict on `experiment`, and whether the drive's microsteps show in its data."""

    experiment: Experiment
    verdict: Verdict
    series: tuple[Series, ...]
    resolved: bool


def diagnose(
    experiment: Experiment, jobs: int = 1, progress: Callable[[str], None] = lambda _: None
) -> Diagnosis:
    """What the machine's model lacks that the experiment's data show.

    A drive whose microsteps show is another model of the same motor: the one that fits
    better is taken. Where a converter's rounding is no noise, `thinned` readings are judged.
    Raises MotionError for a program that cannot be run.
    """
    experiment = thinned(experiment)
    smooth = _judged(Model(experiment), jobs, progress)
    if not any(trial.follows_motion for trial in experiment.trials):
        return smooth
    stepped, left = Model(experiment, resolved=True), _misfit(smooth, Model(experiment))
    mean_square = max(left / sum(map(len, smooth.series)), 1.0)
    if left - _misfit(smooth, stepped) < _STEPS_SHOW * mean_square:
        return smooth
    return _judged(stepped, jobs, progress)


def _judged(model: Model, jobs: int, progress: Callable[[str], None]) -> Diagnosis:
    data = model.series()
    verdict = reconcile(
        model,
        candidates(model.motor),
        data,
        finer=Model(model.experiment, FINE, model.resolved),
        jobs=jobs,
        progress=progress,
    )
    if verdict.verdict == "none":
        verdict = _with_offset(verdict, data, model)
    return Diagnosis(model.experiment, verdict, tuple(data), model.resolved)


def _misfit(found: Diagnosis, model: Model) -> float:
    """Chi-squared of what was found, under another model of the same motor."""
    return float(np.sum(Residuals(model, found.series).at(found.verdict.settings) ** 2))


def _with_offset(verdict: Verdict, data: Sequence[Series], model: Model) -> Verdict:
    """`verdict` with the offsets that all runs share, if they are all there is to find."""
    offset_in = next(
        ((e, e.constant_offset) for e in catalogue().values() if e.constant_offset), None
    )
    if offset_in is None:
        return verdict
    found, predicted = [], model(verdict.settings)
    sensors = {r.sensor.name: r.sensor for t in model.experiment.trials for r in t.readings}
    for sensor in dict.fromkeys(s.sensor for s in data):
        rows = [i for i, s in enumerate(data) if s.sensor == sensor and s.sigma]
        offset = _common_offset(*offset_in, [data[i] for i in rows], [predicted[i] for i in rows])
        if offset:
            rivals = _deflections(offset, sensors.get(sensor), model.experiment.machine)
            found.append(
                replace(offset, form=sensor, rivals=rivals, indistinguishable_from=[*rivals])
            )
    if not found:
        return verdict
    word = "ambiguous" if any(offset.rivals for offset in found) else "named"
    return replace(verdict, verdict=word, effects=tuple(found))


def _deflections(offset: Named, sensor: Sensor | None, machine: Machine) -> dict[str, float]:
    """The effects that may as well, by a plausible force, put the readings as far off everywhere.

    Each with what it costs more: nothing. None for a table, which has no sensor, and for a
    quantity that a force does not change.
    """
    under_load = None if sensor is None else sensor.quantity.under_load
    if sensor is None or under_load is None:
        return {}
    nearest = min(abs(end) for e in offset.parameters.values() for end in e.ci95) * sensor.unit_si
    stiffness_N_m = machine.axis.stiffness_N_m
    return {
        effect.name: 0.0
        for effect in catalogue().values()
        if nearest <= under_load(effect.static_deflection_m(machine), stiffness_N_m)
    }


def _common_offset(
    effect: Effect, parameter: str, data: Sequence[Series], predicted: Sequence[Floats]
) -> Named | None:
    """The offset of one sensor as `parameter` of `effect`.

    Where a run stood at its start is no offset.
    """
    if len(data) < _FEWEST_RUNS:
        return None
    means = np.array([np.mean(s.values - p) for s, p in zip(data, predicted, strict=True)])
    errors = np.array([(s.sigma or 0.0) / math.sqrt(len(s)) for s in data])
    weights = 1 / errors**2
    offset, error = float(means @ weights / weights.sum()), 1 / math.sqrt(weights.sum())
    scatter = float(((means - offset) ** 2) @ weights)
    if abs(offset) < _CLEARLY * error or stats.chi2.sf(scatter, len(data) - 1) < _THE_SAME:
        return None
    others = (means @ weights - means * weights) / (weights.sum() - weights)
    sigmas = abs(offset) / error
    interval = (offset - 1.96 * error, offset + 1.96 * error)
    return Named(
        name=effect.name,
        form="",
        parameters={parameter: Estimate(offset, data[0].unit, interval, False)},
        indistinguishable_from=[],
        rivals={},
        alternatives={},
        log10_bayes_factor=(sigmas**2 - math.log(sum(map(len, data)))) / (2 * math.log(10)),
        sigmas=sigmas,
        held_out=float((means - others) ** 2 @ weights) < float(means**2 @ weights),
    )
