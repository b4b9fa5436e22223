"""A Sawyer motor as an experiment knows it: its model, with and without microsteps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mopro.effects import catalogue_of
from mopro.effects.unlisted import written_terms
from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.residuals import Residuals, without_wild
from mopro.engine.series import Floats, Series, Settings
from mopro.engine.verdict import Verdict, rms
from mopro.experiment.comparison import STEADY
from mopro.experiment.quantisation import SEED, dithered, thinned
from mopro.experiment.sawyer.candidates import candidates, in_one_run, unlisted
from mopro.experiment.sawyer.consistency import check
from mopro.experiment.sawyer.design import propose
from mopro.experiment.sawyer.entries import SawyerEntries, read_sawyer
from mopro.experiment.sawyer.forward_model import COARSE, FINE, ROUGH, ForwardModel
from mopro.experiment.sawyer.labels import PHASES, Labels, labels, labels_of
from mopro.experiment.sawyer.nominal import aligned, planned, predict, predict_table
from mopro.experiment.sawyer.offsets import with_offset
from mopro.experiment.sawyer.repaired import machine_of, machine_text, of_runs
from mopro.experiment.sawyer.runs import read_runs
from mopro.experiment.sawyer.steady import rises, series_of_table
from mopro.experiment.sawyer.trials import Experiment, Reading, SteadyTable
from mopro.experiment.scaled_residuals import quantile_residual
from mopro.experiment.system import Predicted, Proposal, Question, Repaired, Spot, System
from mopro.experiment.wording import advice
from mopro.formula.written import WrittenEffect
from mopro.machine import Machine
from mopro.machine.formulas import read_formulas
from mopro.machine.run_effects import absence_notes
from mopro.plant import Stepping
from mopro.program import AXES
from mopro.source import Source
from mopro.tomlfile import Document, read_source

_TABLE = "table"
# Decrease of chi-squared by which microsteps are taken to be visible; in units of the mean
# square of the residual where that exceeds 1, as any change then takes away a little.
_MICROSTEP_GAIN = 10.0


def load_experiment(path: str | Path, machine: Machine | None = None) -> Experiment:
    """The experiment in file `path`; see `loaded`."""
    return loaded(read_sawyer(Document(read_source(path))), machine)


def loaded(entries: SawyerEntries, machine: Machine | None = None) -> Experiment:
    """The experiment with all its data, checked against the programs.

    It is on `machine` if one is given, else on that of the file; data are checked with the latter.
    Raises ModelError, SourceError, MotionError and DataError, each with all findings of its kind;
    units and columns are not guessed.
    """
    experiment = read_runs(entries)
    found = check(experiment)
    machine = machine or experiment.machine
    absent = absence_notes(machine.name, machine.runs, experiment.trials)
    return replace(experiment, machine=machine, notes=(*experiment.notes, *found, *absent))


@dataclass(frozen=True)
class Sawyer(System):
    """A Sawyer motor with its runs.

    `resolved`: its model has the drive's microsteps, else its angle moves smoothly.
    """

    experiment: Experiment
    resolved: bool = False

    @cached_property
    def model(self) -> Model:
        return Model(self.experiment, resolved=self.resolved)

    @cached_property
    def series(self) -> tuple[Series, ...]:
        return tuple(self.model.series())

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(catalogue_of(self.experiment.machine))

    @property
    def terms(self) -> Mapping[str, WrittenEffect]:
        return written_terms()

    @property
    def program(self) -> Path | None:
        return None

    @property
    def filed(self) -> Mapping[str, Mapping[str, float]]:
        known = {name: self.model.forward.own(name) for name in sorted(self.effects)}
        return {name: own for name, own in known.items() if own}

    def predicted(self, generator: np.random.Generator) -> Iterator[Predicted]:
        experiment, machine = self.experiment, self.experiment.machine
        for trial, values in zip(experiment.trials, predict(experiment), strict=True):
            schedule = planned(trial, machine)
            for reading, own in zip(trial.readings, values, strict=True):
                marks = labels_of(reading, schedule, machine.microstep_m)
                yield _predicted(trial.name, reading, own, marks, generator)
        for table in experiment.tables:
            yield _of_table(table, machine)

    def question(self, left_out: Collection[str]) -> Question:
        experiment, forward = self.experiment, self.model.forward
        tried = candidates(forward, left_out)
        return Question(
            self.model, tried, self.series,
            unlisted=unlisted(forward),
            in_one_run=in_one_run(forward, tried),
            finer=Model(experiment, FINE, self.resolved),
            coarse=Model(experiment, ROUGH, self.resolved),
        )  # fmt: skip

    def tried(self, left_out: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        names = catalogue_of(self.experiment.machine)
        kept = tuple(name for name in names if name not in left_out)
        return kept, tuple(sorted(left_out))

    def judged(
        self, asked: Callable[[System], Verdict], left_out: Collection[str]
    ) -> tuple[System, Verdict]:
        """The model without microsteps is diagnosed first, then the one with them if they show.

        Readings whose noise is below a converter's step are thinned.
        """
        smooth = replace(self, experiment=thinned_experiment(self.experiment))
        verdict = smooth._judged(asked, left_out)
        if not any(trial.follows_motion for trial in smooth.experiment.trials):
            return smooth, verdict
        stepped = replace(smooth, resolved=True)
        if not _show(smooth, verdict, stepped):
            return smooth, verdict
        return stepped, stepped._judged(asked, left_out)

    def _judged(self, asked: Callable[[System], Verdict], left_out: Collection[str]) -> Verdict:
        verdict = asked(self)
        if verdict.verdict != "none":
            return verdict
        return with_offset(verdict, self.series, self.model, self.experiment, left_out)

    def beside(self, stated: Source) -> System:
        machine = self.experiment.machine.beside(Document(stated).read(read_formulas))
        return replace(self, experiment=replace(self.experiment, machine=machine))

    def repaired(self, verdict: Verdict) -> Repaired:
        text = machine_text(self.experiment, verdict)
        machine = machine_of(self.experiment.machine, text)
        again = Model(replace(self.experiment, machine=machine), resolved=self.resolved)
        left = Residuals(again, self.series).calibrated_at({}).of_exact_sensors({})
        sizes = tuple(_rms(s, own) for s, own in zip(self.series, left, strict=True))
        return Repaired(text, tuple(of_runs(self.experiment, verdict)), sizes)

    def next_experiment(self, verdict: Verdict) -> Proposal | None:
        # No program tells what was in a run that is over.
        if any(effect.run for effect in verdict.effects):
            return None
        return propose(self.experiment, verdict)

    def advice(self, verdict: Verdict) -> str:
        return advice(verdict)


def thinned_experiment(experiment: Experiment) -> Experiment:
    """`experiment` with coarse readings thinned, their noise increased accordingly."""
    generator = np.random.default_rng(SEED)

    def own(reading: Reading) -> Reading:
        sensor = reading.sensor
        kept = thinned(reading.values, sensor.adc_step, sensor.noise_rms, generator)
        if kept is None:
            return reading
        noise = dithered(sensor.noise_rms, sensor.adc_step)
        return Reading(replace(sensor, noise_rms=noise), reading.time_s[kept.kept], kept.values)

    trials = (replace(t, readings=tuple(map(own, t.readings))) for t in experiment.trials)
    return replace(experiment, trials=tuple(trials))


def _show(smooth: Sawyer, verdict: Verdict, stepped: Sawyer) -> bool:
    """True if the data call for the microsteps of `stepped`.

    They do so beside the effects of the answer, or in their place: effects may have been named
    for them. Of what stays unexplained without them they must account for a tenth: any change
    of the prediction may take a little off it.
    """
    answer, nothing = verdict.settings, verdict.base_before

    def chi2_of(model: Model, settings: Settings) -> float:
        residuals = Residuals(model, smooth.series).calibrated_at(nothing)
        return float(np.sum(residuals.at(settings) ** 2))

    chi2, samples = chi2_of(smooth.model, answer), sum(map(len, smooth.series))
    gain = chi2 - min(chi2_of(stepped.model, each) for each in (answer, nothing))
    left = chi2 - samples if verdict.verdict == "unexplained" else 0.0
    return gain > max(_MICROSTEP_GAIN * max(chi2 / samples, 1.0), LEAST_SHARE * left)


def _rms(series: Series, residual: Floats) -> float:
    """RMS of a residual (in the unit of the series) without its offset and wild samples."""
    counting, _ = without_wild(series, series.without_nuisances(residual))
    return rms(counting.without_nuisances(residual)[counting.counted])


# -- series and predictions -----------------------------------------------------------------


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
        return [*series_of(self.forward), *map(series_of_table, self.experiment.tables)]


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


# -- a comparison ---------------------------------------------------------------------------


def _predicted(
    run: str, reading: Reading, expected: Floats, marks: Labels, generator: np.random.Generator
) -> Predicted:
    """A reading beside its prediction, by what was commanded at its times."""
    sensor = reading.sensor
    placed = {"position": marks.command_m / sensor.unit_si} if sensor.quantity.sees_place else {}
    series = Series(
        run=run, sensor=sensor.name, unit=sensor.unit, values=reading.values,
        sigma=sensor.sigma or None, time_s=reading.time_s,
        labels={"line": marks.line, **placed},
        position_unit=sensor.unit if placed else "m", tolerances=sensor.tolerances,
    )  # fmt: skip
    axis = sensor.axis if sensor.quantity.of_axis else None
    return Predicted(
        series,
        expected,
        lambda series: _spots(series, marks, axis),
        lambda _, residual: aligned(residual),
        lambda left: quantile_residual(reading.values, reading.values - left, sensor, generator),
    )


def _spots(series: Series, marks: Labels, axis: int | None) -> Iterator[Spot]:
    """The samples of each line, phase and direction, in the order of the lines."""
    for every in _places(marks):
        rows, first = every[series.counted[every]], int(every[0])
        if len(rows):
            line, phase = int(marks.line[first]), str(marks.phase[first])
            yield Spot(rows, phase, line, axis, int(marks.direction[first]))


def _places(labels: Labels) -> Iterator[NDArray[np.intp]]:
    """Indices of the samples of each line, phase and direction, in the order of the lines."""
    codes = np.unique(labels.phase, return_inverse=True)[1]
    keys = (labels.line.astype(np.int64) * len(PHASES) + codes) * 3 + labels.direction
    group = np.unique(keys, return_inverse=True)[1]
    order = np.argsort(group, kind="stable")
    edges = np.flatnonzero(np.diff(group[order])) + 1
    yield from np.split(order, edges)


def _of_table(table: SteadyTable, machine: Machine) -> Predicted:
    """The rises of a table beside those predicted; each row is a spot."""
    series = Series(table.name, _TABLE, "C", table.rise_K, table.noise_K)
    spots = [Spot(np.array([row]), STEADY, row + 1) for row in range(len(series))]
    return Predicted(
        series,
        predict_table(table, machine),
        lambda _: spots,
        lambda _, residual: residual,
        lambda left: left if table.noise_K is None else left / table.noise_K,
    )
