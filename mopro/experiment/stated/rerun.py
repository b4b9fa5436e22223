"""The experiment simulated again on the repaired machine, from its file as it is written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mopro.engine.series import Settings
from mopro.engine.verdict import Verdict
from mopro.errors import DataError, ModelError
from mopro.experiment.stated.compare import compare
from mopro.experiment.stated.of_runs import kept_to_their_runs
from mopro.experiment.stated.repaired import as_written, corrects, machine_of
from mopro.experiment.stated.study import Study, studied
from mopro.formula.evaluate import Floats
from mopro.stated.model import StatedMachine
from mopro.stated.simulation import BASE, Model
from mopro.stated.switched import as_stated

# Difference of two predictions by rounding alone, as a share of the range of the readings.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Rerun:
    """RMS residual of each series as `compare` finds it on the machine of the file, None if not.

    `fault`: why the file must not be written: it does not predict what the verdict says.
    """

    rms: tuple[float | None, ...]
    fault: DataError | None = None


def rerun(study: Study, verdict: Verdict, text: str) -> Rerun:
    """Compare with the machine file `text`, as somebody who applies it will."""
    experiment, settings = study.experiment, as_written(verdict.settings_alone)
    try:
        machine = machine_of(experiment.machine, text)
        applied = studied(replace(study.stated, machine=machine), study.model.foreign)
    except ModelError as error:
        return Rerun((None,) * len(study.series), _fault(study, [error.diagnostics[0].message]))
    found = tuple(own.rms for own in compare(applied).series)
    again = as_stated(kept_to_their_runs(replace(experiment, machine=machine)))
    own = {n: v for n, v in settings.get(BASE, {}).items() if n not in machine.numbers}
    predicted = Model(again, foreign=study.model.foreign)({BASE: own} if own else {})
    # A model takes the step of integration that suits what it is asked first.
    asked = Model(experiment, foreign=study.model.foreign)(settings)
    if _alike(study, predicted, asked):
        return Rerun(found)
    return Rerun(found, _fault(study, list(_missing(experiment.machine, again.machine, settings))))


def _alike(study: Study, one: Sequence[Floats], other: Sequence[Floats]) -> bool:
    """True if the predictions differ by rounding alone."""
    return all(
        float(np.max(np.abs(a - b))) <= _ROUNDING * float(np.ptp(s.values))
        for s, a, b in zip(study.series, one, other, strict=True)
    )


def _missing(rig: StatedMachine, written: StatedMachine, settings: Settings) -> Iterator[str]:
    """Numbers and effects that the file lacks, or has otherwise than fitted; how to state each."""
    for name, number in rig.numbers.items():
        own = settings.get(name if corrects(rig, name) else BASE, {}).get(name, number.value)
        if not math.isclose(written.numbers[name].value, own, rel_tol=_ROUNDING):
            stated = f'{name} = {{ value = {own!r}, unit = "{number.unit}" }}'
            yield f"{name} of [base] was not written: state it there in one line, as {stated}"
    for name, values in settings.items():
        if name != BASE and not corrects(rig, name) and written.active.get(name) != values:
            yield f"{name} was not written: state it in a section [effects.NAME] of its own"


def _fault(study: Study, reasons: Sequence[str]) -> DataError:
    why = "; ".join(reasons) or "its effects act in another order, or on other sensors"
    message = (
        f"the repaired file would not predict what the verdict says, and is not written: {why}"
    )
    return DataError(f"{study.experiment.machine.source.name}: {message}", "not-as-fitted")
