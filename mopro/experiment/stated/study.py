"""An experiment on a machine of another kind, with its model and the free numbers fitted."""

from __future__ import annotations

import importlib.util
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.engine.candidate import Parameter
from mopro.engine.residuals import Residuals
from mopro.engine.series import Series
from mopro.errors import DataError, ModelError
from mopro.experiment.stated.bare import completed
from mopro.experiment.stated.doubts import check_scales, unstated_steps
from mopro.experiment.stated.entries import StatedEntries
from mopro.experiment.stated.of_runs import kept_to_their_runs
from mopro.experiment.stated.read import read_stated_experiment
from mopro.formula.evaluate import Floats
from mopro.inputs import no_file
from mopro.stated.base import BaseFit, base_of, fitted_base
from mopro.stated.data import StatedExperiment
from mopro.stated.input_noise import beside_input_noise, stated_noise
from mopro.stated.names import check, effects_of
from mopro.stated.origin import with_one_origin
from mopro.stated.series import plain_series, series_of
from mopro.stated.simulation import Model, Simulate
from mopro.stated.switched import as_stated
from mopro.tomlfile import Document

# What a program that is somebody's model may raise.
_OF_A_PROGRAM = (
    ArithmeticError, AssertionError, AttributeError, ImportError, LookupError, MemoryError,
    NameError, OSError, RuntimeError, SyntaxError, SystemExit, TypeError, ValueError,
)  # fmt: skip


@dataclass(frozen=True)
class Study:
    """The model, its data, and the free numbers as they fit without effects.

    `stated`: the experiment as its file has it, before signs and zeros were chosen.
    """

    stated: StatedExperiment
    experiment: StatedExperiment
    model: Model
    base: BaseFit
    series: tuple[Series, ...]

    def residuals(self, predicted: Sequence[Floats]) -> list[Floats]:
        """Measured less predicted, without the fitted offsets and drifts, in each unit."""
        return [
            s.without_nuisances(s.values - own)
            for s, own in zip(self.series, predicted, strict=True)
        ]


def study(entries: StatedEntries, allow_python: bool = False) -> Study:
    """Read, check and fit an experiment. ModelError, DataError.

    A model that is a program is run only if `allow_python`.
    """
    foreign = _foreign(entries, allow_python)
    return studied(completed(read_stated_experiment(entries)), foreign)


def studied(stated: StatedExperiment, foreign: Simulate | None) -> Study:
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
    doubts = (f"{n.name}: {n.doubt}" for n in experiment.machine.numbers.values() if n.doubt)
    notes = [*doubts, *check_scales(model, data, base), *base.notes, *unstated_steps(model)]
    series = tuple(data) if foreign else tuple(series_of(model, base.settings))
    if not foreign and (noises := stated_noise(model)):
        series = beside_input_noise(model, base.settings, series, noises)
    experiment = replace(experiment, notes=(*experiment.notes, *notes))
    return Study(stated, experiment, model, base, series)


def _check_apart(experiment: StatedExperiment) -> None:
    """ModelError where one name would stand for two things that are fitted.

    A number with a tolerance is looked for under its name, as an effect is; a program is given
    numbers and parameters together.
    """
    rig, effects = experiment.machine, effects_of(experiment)
    for name in {effect.name for effect in effects} & rig.numbers.keys():
        if rig.numbers[name].tolerance:
            message = f"{name} is the name of an effect as well, and has a tolerance"
            number = Document(rig.source).root["base"][name]
            raise number.error(message, "double-name", f"call it otherwise, such as {name}_1")
    if rig.python is None:
        return
    taken = dict.fromkeys(rig.numbers, "a number of [base]")
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


def _foreign(entries: StatedEntries, allowed: bool) -> Simulate | None:
    """The function of a model that is a program."""
    if entries.machine.python is None or entries.foreign is None:
        return None
    file, name = entries.foreign, entries.machine.python[1]
    if not allowed:
        raise DataError(
            f"{entries.machine.name} is a program, {file}, and is run only with --allow-python: "
            "look at it first, if it is not yours",
            "not-allowed",
        )
    return _loaded(file, name)


def _loaded(file: Path, name: str) -> Simulate:
    spec = importlib.util.spec_from_file_location("mopro_foreign_model", file)
    wrong = no_file(file, str(file))
    if wrong or spec is None or spec.loader is None:
        raise DataError(wrong or f"{file}: expected a file of Python", "no-such-file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except _OF_A_PROGRAM as error:
        raise _failed(file, error) from error
    function = getattr(module, name, None)
    if not callable(function):
        raise DataError(f"{file} has no function {name}", "no-such-function")

    def simulate(numbers: Mapping[str, float], columns: Mapping[str, Floats]) -> Mapping[str, Any]:
        try:
            found: Mapping[str, Any] = function(numbers, columns)
        except _OF_A_PROGRAM as error:
            raise _failed(file, error) from error
        return found

    return simulate


def _failed(file: Path, error: BaseException) -> DataError:
    """The error of a model that is a program, with the line of it that was running."""
    own = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
    place = f", line {own[-1]}" if own else ""
    return DataError(f"{file}{place}: {type(error).__name__}: {error}", "failed-model")


__all__ = ["ModelError", "Study", "study"]
