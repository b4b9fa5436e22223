"""A stated machine as an experiment knows it: its model, with the free numbers fitted."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from mopro.engine.candidate import Candidate, Parameter
from mopro.engine.residuals import Residuals
from mopro.engine.series import Floats, Series
from mopro.engine.verdict import Verdict
from mopro.errors import DataError
from mopro.experiment.quantisation import SEED, dithered, thinned
from mopro.experiment.stated.entries import StatedEntries
from mopro.experiment.stated.from_kind import completed
from mopro.experiment.stated.next_run import propose
from mopro.experiment.stated.noisy_inputs import beside_noise
from mopro.experiment.stated.one_speed import at_one_speed
from mopro.experiment.stated.python_model import foreign_model
from mopro.experiment.stated.read import read_stated_experiment
from mopro.experiment.stated.repaired import effects_of_runs, kept_to_their_runs, machine_text
from mopro.experiment.stated.rerun import rerun
from mopro.experiment.stated.scales import check_scales, ends, unstated_steps
from mopro.experiment.stated.undecided import with_undecided
from mopro.experiment.system import Predicted, Proposal, Question, Repaired, Spot, System
from mopro.experiment.wording import advice
from mopro.formula.entry import read_effects
from mopro.formula.signals import side
from mopro.formula.written import WrittenEffect
from mopro.source import Source
from mopro.stated.base import BaseFit, base_of, fitted_base
from mopro.stated.candidates import candidates, in_one_run, unlisted
from mopro.stated.data import Reading, Run, StatedExperiment
from mopro.stated.file import HOSTS
from mopro.stated.input_noise import beside_input_noise, stated_noise
from mopro.stated.names import check, effects_of, unlisted_of
from mopro.stated.origin import with_one_origin
from mopro.stated.reading_series import plain_series, series_of
from mopro.stated.simulation import Model, Simulate
from mopro.stated.switched import as_stated
from mopro.tomlfile import Document

_ADVICE = (
    "A run that is driven in another way, another sensor, or a known change of the machine "
    "(`without` in a run) may distinguish them."
)


@dataclass(frozen=True)
class Stated(System):
    """A stated machine with its runs.

    `stated`: the experiment as its file has it, before signs and zeros were chosen. `base`: the
    free numbers as they fit without effects.
    """

    stated: StatedExperiment
    experiment: StatedExperiment
    model: Model
    base: BaseFit
    series: tuple[Series, ...]

    @property
    def effects(self) -> frozenset[str]:
        numbers = self.experiment.machine.numbers.values()
        own = {number.name for number in numbers if number.tolerance}
        return frozenset(own | {effect.name for effect in self.model.forms})

    @property
    def terms(self) -> Mapping[str, WrittenEffect]:
        return {effect.name: effect for effect in unlisted_of(self.experiment)}

    @property
    def program(self) -> Path | None:
        machine = self.experiment.machine
        return machine.python and Path(machine.source.name).parent / machine.python[0]

    @property
    def filed(self) -> Mapping[str, Mapping[str, float]]:
        return self.experiment.machine.active

    def predicted(self, generator: np.random.Generator) -> list[Predicted]:
        values = self.model(self.base.settings)
        return [
            Predicted(s, own, _spots, Series.without_nuisances, _scaled(s))
            for s, own in zip(self.series, values, strict=True)
        ]

    @cached_property
    def _candidates(self) -> list[Candidate]:
        return candidates(self.model, self.series, self.base.settings)

    def question(self, left_out: Collection[str]) -> Question:
        tried = [c for c in self._candidates if c.name not in left_out]
        return Question(
            self.model, tried, self.series, base=self.base.parameters,
            unlisted=unlisted(self.model, self.series, self.base.settings),
            in_one_run=in_one_run(self.model, tried),
            runs_on=self.model.runs_on,
        )  # fmt: skip

    def tried(self, left_out: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        names = dict.fromkeys(c.name for c in self._candidates)
        kept = tuple(name for name in names if name not in left_out)
        return kept, tuple(sorted(names.keys() & set(left_out)))

    def judged(
        self, asked: Callable[[System], Verdict], left_out: Collection[str]
    ) -> tuple[System, Verdict]:
        """Readings whose noise is below a converter's step are thinned."""
        own = self._thinned()
        series, verdict, notes = beside_noise(
            own.model, own.series, own.base.settings,
            lambda series: asked(replace(own, series=tuple(series))),
        )  # fmt: skip
        experiment = replace(own.experiment, notes=(*own.experiment.notes, *notes))
        verdict = with_undecided(own.model, at_one_speed(own.model, series, verdict))
        return replace(own, experiment=experiment, series=tuple(series)), verdict

    def beside(self, stated: Source) -> System:
        host = HOSTS[self.experiment.machine.kind]
        effects = Document(stated).read(lambda root: read_effects(root, host))
        machine = self.experiment.machine.beside(effects)
        experiment = replace(self.experiment, machine=machine)
        model = Model(experiment, foreign=self.model.foreign)
        return replace(self, experiment=experiment, model=model)

    def repaired(self, verdict: Verdict) -> Repaired:
        return self.again(verdict, machine_text(self.model, verdict))

    def again(self, verdict: Verdict, text: str) -> Repaired:
        """A machine file and what it predicts, which should be what the verdict says."""
        rms, fault = rerun(
            self.model, self.series, verdict, text,
            lambda machine: studied(replace(self.stated, machine=machine), self.model.foreign),
        )  # fmt: skip
        of_runs = effects_of_runs(self.model, verdict.fitted, verdict.settings_alone)
        return Repaired(text, tuple(of_runs), rms, fault)

    def next_experiment(self, verdict: Verdict) -> Proposal | None:
        # No motion tells what was in a run that is over.
        if any(effect.run for effect in verdict.effects):
            return None
        return propose(self._thinned().model, verdict)

    def _thinned(self) -> Stated:
        """This system as it is judged; itself where no reading is coarse."""
        coarse = thinned_experiment(self.stated)
        return self if coarse is self.stated else studied(coarse, self.model.foreign)

    def advice(self, verdict: Verdict) -> str:
        return advice(verdict, _ADVICE)


def _scaled(series: Series) -> Callable[[Floats], Floats]:
    """A residual in standard deviations of the noise; in its unit where the noise is unknown."""
    return lambda left: left if series.sigma is None else left / series.sigma


def _spots(series: Series) -> Iterator[Spot]:
    """Each part of a run, in each direction of the motion."""
    assert series.folds is not None, "a reading has parts"
    assert series.time_s is not None, "a reading has times"
    velocity = series.labels.get("velocity")
    direction = np.zeros(len(series))
    if velocity is not None:
        direction = side(series.time_s, np.asarray(velocity, dtype=float))
    keys = series.folds * 3 + direction.astype(np.int64)
    for key in np.unique(keys):
        rows = np.flatnonzero((keys == key) & series.counted)
        if len(rows):
            first, last = series.time_s[rows[[0, -1]]]
            phase = f"{first:.4g} to {last:.4g} s"
            yield Spot(rows, phase, direction=int(direction[rows[0]]))


# -- reading, checks and the first fit ------------------------------------------------------


def stated_system(entries: StatedEntries, allow_python: bool = False) -> Stated:
    """Read, check and fit an experiment. ModelError, DataError.

    A model that is a program is run only if `allow_python`.
    """
    foreign = foreign_model(entries, allow_python)
    return studied(completed(read_stated_experiment(entries)), foreign)


def thinned_experiment(stated: StatedExperiment) -> StatedExperiment:
    """`stated` with coarse readings thinned, their noise increased accordingly; itself without."""
    generator = np.random.default_rng(SEED)
    trials = tuple(
        replace(run, readings=tuple(_thinned(reading, generator) for reading in run.readings))
        for run in stated.trials
    )
    same = all(map(operator.is_, _readings(trials), _readings(stated.trials)))
    return stated if same else replace(stated, trials=trials)


def _readings(trials: Sequence[Run]) -> list[Reading]:
    return [reading for run in trials for reading in run.readings]


def _thinned(reading: Reading, generator: np.random.Generator) -> Reading:
    sensor, rms = reading.sensor, reading.sensor.noise_rms
    if not sensor.step:
        return reading
    noise = None if rms is None else math.sqrt(max(rms**2 - sensor.step**2 / 12, 0.0))
    kept = thinned(reading.values, sensor.step, noise, generator)
    if kept is None:
        return reading
    sensor = replace(sensor, noise_rms=None if rms is None else dithered(rms, sensor.step))
    return Reading(sensor, reading.rows[kept.kept], kept.values, reading.first)


def studied(stated: StatedExperiment, foreign: Simulate | None) -> Stated:
    """Check and fit an experiment that was read; `foreign` is its model if that is a program."""
    experiment = as_stated(kept_to_their_runs(stated))
    check(experiment, effects_of(experiment))
    _check_apart(experiment)
    experiment = _with_signs(experiment, foreign)
    experiment = with_one_origin(experiment, Model(experiment, foreign=foreign))
    model = Model(experiment, foreign=foreign)
    parameters = base_of(model)
    data = plain_series(model)
    _check_runs(model, parameters)
    base = fitted_base(model, data, parameters)
    numbers = experiment.machine.numbers.values()
    own = (f"{number.name}: {number.note}" for number in numbers if number.note)
    notes = [*own, *check_scales(model, data, base), *base.notes, *unstated_steps(model)]
    notes += ends(model, base)
    series = tuple(data) if foreign else tuple(series_of(model, base.settings))
    if not foreign and (noises := stated_noise(model)):
        series = beside_input_noise(model, base.settings, series, noises)
    experiment = replace(experiment, notes=(*experiment.notes, *notes))
    return Stated(stated, experiment, model, base, series)


def _check_apart(experiment: StatedExperiment) -> None:
    """ModelError where one name would stand for two things that are fitted.

    A number with a tolerance is looked for under its name, as an effect is; a program is given
    numbers and parameters together.
    """
    machine, effects = experiment.machine, effects_of(experiment)
    for name in {effect.name for effect in effects} & machine.numbers.keys():
        if machine.numbers[name].tolerance:
            message = f"{name} is the name of an effect as well, and has a tolerance"
            number = Document(machine.source).root["base"][name]
            raise number.error(message, "double-name", f"call it otherwise, such as {name}_1")
    if machine.python is None:
        return
    taken = dict.fromkeys(machine.numbers, "a number of [base]")
    for effect in effects:
        for p in effect.parameters:
            of = taken.setdefault(p.name, f"a parameter of {effect.name}")
            if of != f"a parameter of {effect.name}" and effect.value is not None:
                message = f"{p.name} is {of} already, and the program is given all in one dict"
                hint = f"call it otherwise, such as {p.name}_1"
                raise effect.value[p.name].error(message, "double-name", hint)


def _check_runs(model: Model, parameters: Sequence[Parameter]) -> None:
    """ModelError if the model without effects leaves the finite numbers."""
    predicted = model(BaseFit(tuple(parameters)).settings)
    for (run, reading), own in zip(model.readings, predicted, strict=True):
        wrong = np.flatnonzero(~np.isfinite(own))
        if len(own) != len(reading.values):
            raise DataError(f"the model gives {len(own)} values for {len(reading.values)} measured")
        if len(wrong) and run.value is not None:
            at = float(run.time_s[reading.rows[wrong[0]]])
            message = (
                f"the model of {reading.sensor.name} gives no finite number at {at:.6g} s: it "
                "divides by zero, or runs away"
            )
            raise run.value.error(
                message, "not-finite", "look at the law and the numbers of the machine"
            )


def _with_signs(experiment: StatedExperiment, foreign: Simulate | None) -> StatedExperiment:
    """The experiment with each free sign as it fits better."""
    free = {
        r.sensor.name for run in experiment.trials for r in run.readings if r.sensor.sign is None
    }
    for name in sorted(free):
        ways = [_signed(experiment, name, sign) for sign in (1, -1)]
        experiment = min(ways, key=lambda way: _misfit(way, foreign))
    return experiment


def _signed(experiment: StatedExperiment, name: str, sign: int) -> StatedExperiment:
    trials = tuple(
        replace(run, readings=tuple(
            replace(r, sensor=replace(r.sensor, sign=sign)) if r.sensor.name == name else r
            for r in run.readings
        ))
        for run in experiment.trials
    )  # fmt: skip
    note = f"sensor {name}: its sign is free, and {sign:+d} fits better"
    others = tuple(n for n in experiment.notes if not n.startswith(f"sensor {name}: its sign"))
    return replace(experiment, trials=trials, notes=(*others, note))


def _misfit(experiment: StatedExperiment, foreign: Simulate | None) -> float:
    model = Model(experiment, foreign=foreign)
    data = plain_series(model)
    base = fitted_base(model, data, base_of(model))
    return float(np.sum(Residuals(model, data).at(base.settings) ** 2))
