"""The experiment simulated again on the repaired machine, from its file as it is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mopro.engine.series import Series, Settings
from mopro.engine.verdict import Verdict
from mopro.errors import DataError, ModelError
from mopro.experiment.comparison import compare
from mopro.experiment.stated.repaired import as_written, corrects, kept_to_their_runs, machine_of
from mopro.experiment.system import System
from mopro.formula.evaluate import Floats
from mopro.stated.model import StatedMachine
from mopro.stated.simulation import BASE, Model
from mopro.stated.switched import as_stated

# Difference of two predictions by rounding alone, as a share of the range of the readings.
_ROUNDING = 1e-6
# RMS residual of each series as `compare` finds it, None where the file cannot be read; why the
# file must not be written.
Rerun = tuple[tuple[float | None, ...], DataError | None]


def rerun(
    model: Model,
    series: Sequence[Series],
    verdict: Verdict,
    text: str,
    applied: Callable[[StatedMachine], System],
) -> Rerun:
    """Compare with the machine file `text`, as somebody who applies it will.

    `applied`: the experiment on another machine, read, checked and fitted.
    """
    experiment, settings = model.experiment, as_written(verdict.settings_alone)
    try:
        machine = machine_of(experiment.machine, text)
        found = tuple(own.rms for own in compare(applied(machine)).series)
    except ModelError as error:
        return (None,) * len(series), _fault(model, [error.diagnostics[0].message])
    again = as_stated(kept_to_their_runs(replace(experiment, machine=machine)))
    own = {n: v for n, v in settings.get(BASE, {}).items() if n not in machine.numbers}
    predicted = Model(again, foreign=model.foreign)({BASE: own} if own else {})
    # A model takes the step of integration that suits what it is asked first.
    asked = Model(experiment, foreign=model.foreign)(settings)
    if _alike(series, predicted, asked):
        return found, None
    return found, _fault(model, list(_missing(experiment.machine, again.machine, settings)))


def _alike(series: Sequence[Series], one: Sequence[Floats], other: Sequence[Floats]) -> bool:
    """True if the predictions differ by rounding alone."""
    return all(
        float(np.max(np.abs(a - b))) <= _ROUNDING * float(np.ptp(s.values))
        for s, a, b in zip(series, one, other, strict=True)
    )


def _missing(machine: StatedMachine, written: StatedMachine, settings: Settings) -> Iterator[str]:
    """Numbers and effects that the file lacks, or has otherwise than fitted; how to state each."""
    for name, number in machine.numbers.items():
        own = settings.get(name if corrects(machine, name) else BASE, {}).get(name, number.value)
        if not math.isclose(written.numbers[name].value, own, rel_tol=_ROUNDING):
            stated = f'{name} = {{ value = {own!r}, unit = "{number.unit}" }}'
            yield f"{name} of [base] was not written: state it there in one line, as {stated}"
    for name, values in settings.items():
        if name != BASE and not corrects(machine, name) and written.active.get(name) != values:
            yield f"{name} was not written: state it in a section [effects.NAME] of its own"


def _fault(model: Model, reasons: Sequence[str]) -> DataError:
    why = "; ".join(reasons) or "its effects act in another order, or on other sensors"
    message = (
        f"the repaired file would not predict what the verdict says, and is not written: {why}"
    )
    return DataError(f"{model.machine.source.name}: {message}", "not-as-fitted")
