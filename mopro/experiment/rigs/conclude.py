"""Diagnosis of an experiment on a machine of another kind, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

from mopro.diagnosis import reconcile
from mopro.errors import DataError
from mopro.experiment.conclude.conclusion import Conclusion
from mopro.experiment.conclude.wording import advice
from mopro.experiment.rigs.compare import compare, worst
from mopro.experiment.rigs.repaired import machine_text, machine_with
from mopro.experiment.rigs.study import Study
from mopro.residuals import Residuals
from mopro.rig.candidates import candidates, unlisted
from mopro.rig.simulation import BASE, Model
from mopro.verdict import Verdict, rms

_MOST_PLACES = 40
_ADVICE = (
    "A run that is driven in another way, another sensor, or a known change of the machine "
    "(`without` in a run) may distinguish them."
)


def conclude(
    study: Study,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
) -> Conclusion:
    """Find the effects that the machine lacks, without those in `left_out`, and repair its file."""
    progress("comparing")
    places = compare(study).where
    every = candidates(study.model, study.series, study.base.settings)
    tried = [c for c in every if c.name not in left_out]
    try:
        verdict = reconcile(
            study.model, tried, study.series, base=study.base.parameters, jobs=jobs,
            progress=progress,
            unlisted=unlisted(study.model, study.series, study.base.settings),
        )  # fmt: skip
    except ValueError as error:
        raise DataError(f"{study.experiment.source.name}: {error}", "not-finite") from error
    progress("simulating the experiment again with the effects found")
    return Conclusion(
        experiment=study.experiment,
        series=study.series,
        verdict=verdict,
        where=worst(places, _MOST_PLACES),
        machine_text=machine_text(study.experiment, verdict),
        rerun_rms=_rerun(study, verdict),
        next_experiment=None,
        left_out=tuple(sorted({c.name for c in every} & set(left_out))),
        advice=advice(verdict, _ADVICE),
        tried=tuple(dict.fromkeys(c.name for c in tried)),
    )


def names(study: Study) -> frozenset[str]:
    """The names of all candidates."""
    own = {number.name for number in study.experiment.machine.numbers.values() if number.tolerance}
    return frozenset(own | {effect.name for effect in study.model.forms})


def _rerun(study: Study, verdict: Verdict) -> tuple[float, ...]:
    """RMS of the residual on the repaired machine; starts and scales are those of the verdict."""
    machine = machine_with(study.experiment, verdict)
    again = Model(replace(study.experiment, machine=machine), foreign=study.model.foreign)
    own = {n: v for n, v in verdict.settings.get(BASE, {}).items() if n not in machine.numbers}
    settings = {BASE: own} if own else {}
    residuals = Residuals(again, study.series, scaled_at=settings).calibrated_at(settings)
    left = residuals.of_exact_sensors(settings)
    return tuple(rms(s.without_nuisances(each)) for s, each in zip(study.series, left, strict=True))
