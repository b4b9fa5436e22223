"""Runs the diagnosis on an experiment: its model, candidates and data."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from mopro.effects import Effect, catalogue_of
from mopro.engine import reconcile
from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.residuals import Residuals, noise_of
from mopro.engine.series import Series, Settings
from mopro.engine.verdict import Estimate, Named, Verdict
from mopro.experiment.sawyer import thermal
from mopro.experiment.sawyer.candidates import candidates, in_one_run, unlisted
from mopro.experiment.sawyer.forward_model import COARSE, FINE, ROUGH, ForwardModel
from mopro.experiment.sawyer.labels import labels, labels_of
from mopro.experiment.sawyer.model import Experiment, Floats, Reading
from mopro.experiment.sawyer.quantisation import thinned
from mopro.experiment.sawyer.steady import rises
from mopro.instruments.sensor import Sensor
from mopro.machine import Machine
from mopro.plant import Stepping
from mopro.program import AXES


def series_of(model: ForwardModel) -> list[Series]:
    """A Series for each reading of the runs, in order, with the folds to hold out."""
    return [
        _series(model, index, reading)
        for index, trial in enumerate(model.experiment.trials)
        for reading in trial.readings
    ]


def _series(model: ForwardModel, index: int, reading: Reading) -> Series:
    experiment, sensor = model.experiment, reading.sensor
    own = labels_of(reading, model.schedule(index), experiment.machine.microstep_m)
    quantity = sensor.quantity
    # Positions are in the unit of a sensor that measures them, else in metres.
    unit = "m" if quantity.follows_motion and not quantity.sees_place else sensor.unit
    scale = 1 / sensor.unit_si if quantity.sees_place else 1.0
    other = next(axis for axis in AXES if axis != sensor.axis)
    beside = labels(model.schedule(index), other, reading.time_s, experiment.machine.microstep_m)
    motion = {
        "position": own.command_m * scale,
        "velocity": own.velocity_m_s * scale,
        "acceleration": own.acceleration_m_s2 * scale,
        "other_position": beside.command_m * scale,
    }
    return Series(
        run=experiment.trials[index].name,
        sensor=sensor.name,
        unit=sensor.unit,
        values=reading.values,
        sigma=sensor.sigma or None,
        time_s=reading.time_s,
        folds=own.move,
        # What heat alone makes is not described by the place and speed of the axis.
        labels={"line": own.line, **(motion if quantity.follows_motion else {})},
        position_unit=unit,
        of_place=quantity.sees_place,
        tolerances=sensor.tolerances,
    )


# In σ: least size of an offset that is reported.
_OFFSET_SIGMAS = 6.0
# P-value below which the offsets of the runs are not the same.
_SAME_OFFSET_P = 1e-3
_FEWEST_RUNS = 2
# Decrease of chi-squared by which microsteps are taken to be visible; in units of the mean
# square of the residual where that exceeds 1, as any change then takes away a little.
_MICROSTEP_GAIN = 10.0


class Model:
    """Model of all readings and tables of an experiment; called with settings of effects."""

    def __init__(
        self,
        experiment: Experiment,
        stepping: Stepping = COARSE,
        resolved: bool = False,
    ) -> None:
        self.experiment = experiment
        self.resolved = resolved
        self.forward = ForwardModel(experiment, stepping, resolved)

    def __call__(self, settings: Settings) -> list[Floats]:
        machine = self.experiment.machine
        tables = [rises(table, machine, settings) for table in self.experiment.tables]
        return [*self.forward(settings), *tables]

    def series(self) -> list[Series]:
        return [*series_of(self.forward), *map(thermal.series, self.experiment.tables)]


@dataclass(frozen=True)
class Diagnosis:
    """The verdict on `experiment`; `resolved` if the drive's microsteps show in its data."""

    experiment: Experiment
    verdict: Verdict
    series: tuple[Series, ...]
    resolved: bool


def diagnose(
    experiment: Experiment,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
) -> Diagnosis:
    """Find the effects that the machine's model lacks and the experiment's data show.

    Effects whose names are in `left_out` are no candidates and no alternatives.

    The model without microsteps is diagnosed first, then the one with them if they show.
    Readings whose noise is below a converter's step are `thinned`.
    Raises MotionError for a program that cannot be run.
    """
    experiment = thinned(experiment)
    smooth = _judged(Model(experiment), jobs, progress, left_out)
    if not any(trial.follows_motion for trial in experiment.trials):
        return smooth
    stepped = Model(experiment, resolved=True)
    if not _show(smooth, stepped):
        return smooth
    return _judged(stepped, jobs, progress, left_out)


def _show(smooth: Diagnosis, stepped: Model) -> bool:
    """True if the data call for the microsteps of `stepped`.

    They do so beside the effects of the answer, or in their place: effects may have been named
    for them. Of what stays unexplained without them they must account for a tenth: any change
    of the prediction may take a little off it.
    """
    answer, nothing = smooth.verdict.settings, smooth.verdict.base_before
    chi2, samples = _chi2(smooth, Model(smooth.experiment), answer), sum(map(len, smooth.series))
    gain = chi2 - min(_chi2(smooth, stepped, each) for each in (answer, nothing))
    left = chi2 - samples if smooth.verdict.verdict == "unexplained" else 0.0
    return gain > max(_MICROSTEP_GAIN * max(chi2 / samples, 1.0), LEAST_SHARE * left)


def _judged(
    model: Model, jobs: int, progress: Callable[[str], None], left_out: Collection[str]
) -> Diagnosis:
    data = model.series()
    tried = candidates(model.forward, left_out)
    verdict = reconcile(
        model,
        tried,
        data,
        in_one_run=in_one_run(model.forward, tried),
        unlisted=unlisted(model.forward),
        finer=Model(model.experiment, FINE, model.resolved),
        coarse=Model(model.experiment, ROUGH, model.resolved),
        jobs=jobs,
        progress=progress,
    )
    if verdict.verdict == "none":
        verdict = _with_offset(verdict, data, model, left_out)
    return Diagnosis(model.experiment, verdict, tuple(data), model.resolved)


def _chi2(diagnosis: Diagnosis, model: Model, settings: Settings) -> float:
    """Chi-squared of `model` with `settings` against the data of a diagnosis."""
    residuals = Residuals(model, diagnosis.series).calibrated_at(diagnosis.verdict.base_before)
    return float(np.sum(residuals.at(settings) ** 2))


def _with_offset(
    verdict: Verdict, data: Sequence[Series], model: Model, left_out: Collection[str]
) -> Verdict:
    """`verdict` (none) with the sensor offsets that all runs share, if there are any.

    A zero that is off is a calibration; one that may as well be a force is told with that.
    """
    effects = catalogue_of(model.experiment.machine).values()
    kept = [effect for effect in effects if effect.name not in left_out]
    offset_in = next(((e, e.constant_offset) for e in kept if e.constant_offset), None)
    if offset_in is None:
        return verdict
    residuals = Residuals(model, data).calibrated_at(verdict.base_before)
    # A verdict of `none` has no effects, so no parameters were fitted.
    residual, offsets = residuals.at(verdict.settings), []
    left = residuals.of_exact_sensors(verdict.settings)
    power = noise_of(residuals, residual, 0).power_of_means(residual)
    sensors = {r.sensor.name: r.sensor for t in model.experiment.trials for r in t.readings}
    for sensor in dict.fromkeys(s.sensor for s in data):
        rows = [i for i, s in enumerate(data) if s.sensor == sensor and s.sigma]
        means = [float(np.mean(left[i])) for i in rows]
        memory = math.sqrt(float(np.mean(power[rows]))) if rows else 1.0
        offset = _common_offset(*offset_in, [data[i] for i in rows], means, memory)
        if offset:
            rivals = _deflections(offset, sensors.get(sensor), model.experiment.machine, kept)
            offsets.append(
                replace(offset, form=sensor, rivals=rivals, indistinguishable_from=[*rivals])
            )
    doubtful = tuple(offset for offset in offsets if offset.rivals)
    zeros = tuple(offset for offset in offsets if not offset.rivals)
    word = "ambiguous" if doubtful else verdict.verdict
    return replace(verdict, verdict=word, effects=doubtful, sensors=(*verdict.sensors, *zeros))


def _deflections(
    offset: Named, sensor: Sensor | None, machine: Machine, effects: Iterable[Effect]
) -> dict[str, float]:
    """Those of `effects` that shift all readings as far by a plausible force, each with ΔEBIC zero.

    Empty for a table, which has no sensor, and for a quantity that a force does not change.
    """
    under_load = None if sensor is None else sensor.quantity.under_load
    if sensor is None or under_load is None:
        return {}
    nearest = min(abs(end) for e in offset.parameters.values() for end in e.ci95) * sensor.unit_si
    stiffness_N_m = machine.axis.stiffness_N_m
    return {
        effect.name: 0.0
        for effect in effects
        if nearest <= under_load(effect.static_deflection_m(machine), stiffness_N_m)
    }


def _common_offset(
    effect: Effect, parameter: str, data: Sequence[Series], of_runs: Sequence[float], memory: float
) -> Named | None:
    """The offset of one sensor over its runs as `parameter` of `effect`.

    of_runs: that of each run, in the sensor's unit; memory: standard deviation of a mean over that
    of white noise. None for a single run (its position at the start is unknown), for an offset
    below _OFFSET_SIGMAS, or for runs that differ.
    """
    if len(data) < _FEWEST_RUNS:
        return None
    means = np.array(of_runs)
    errors = np.array([memory * (s.sigma or 0.0) / math.sqrt(len(s)) for s in data])
    weights = 1 / errors**2
    offset, error = float(means @ weights / weights.sum()), 1 / math.sqrt(weights.sum())
    scatter = float(((means - offset) ** 2) @ weights)
    if (
        abs(offset) < _OFFSET_SIGMAS * error
        or special.chdtrc(len(data) - 1, scatter) < _SAME_OFFSET_P
    ):
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
