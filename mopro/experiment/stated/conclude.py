"""Diagnosis of an experiment on a machine of another kind, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from mopro.engine import reconcile
from mopro.engine.verdict import Verdict
from mopro.errors import DataError
from mopro.experiment.conclude.conclusion import Conclusion
from mopro.experiment.conclude.wording import advice
from mopro.experiment.stated.compare import compare, worst
from mopro.experiment.stated.drafted import drafted
from mopro.experiment.stated.noisy_inputs import beside_noise
from mopro.experiment.stated.one_speed import at_one_speed
from mopro.experiment.stated.repaired import effects_of_runs, machine_text
from mopro.experiment.stated.rerun import rerun
from mopro.experiment.stated.study import Study
from mopro.stated.candidates import candidates, in_one_run, unlisted
from mopro.stated.model import StatedMachine

_MOST_PLACES = 40
_ADVICE = (
    "A run that is driven in another way, another sensor, or a known change of the machine "
    "(`without` in a run) may distinguish them."
)
# What a library says of such numbers tells nobody what to do.
_NOT_FINITE = (
    "{}: with some effects the model comes to numbers that cannot be worked with: look at the "
    "signs of its law and at the ranges of its free numbers, or leave effects out with --without"
)


def conclude(
    study: Study,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
    with_drafts: bool = False,
) -> Conclusion:
    """Find the effects that the machine lacks, without those in `left_out`, and repair its file.

    The file has drafts inside the machine's equations as well if `with_drafts`.
    """
    progress("comparing")
    places = compare(study).where
    every = candidates(study.model, study.series, study.base.settings)
    tried = [c for c in every if c.name not in left_out]

    def asked(study: Study) -> Verdict:
        try:
            return reconcile(
                study.model, tried, study.series, base=study.base.parameters, jobs=jobs,
                progress=progress, in_one_run=in_one_run(study.model, tried),
                unlisted=unlisted(study.model, study.series, study.base.settings),
            )  # fmt: skip
        except ValueError as error:
            message = _NOT_FINITE.format(study.experiment.source.name)
            raise DataError(message, "not-finite") from error

    study, verdict = beside_noise(study, asked)
    verdict = at_one_speed(study, verdict)
    progress("simulating the experiment again with the effects found")
    as_filed, filed = drafted(study, verdict) if with_drafts else (study, verdict)
    text = machine_text(as_filed.experiment, filed)
    again = rerun(as_filed, filed, text)
    return Conclusion(
        experiment=study.experiment,
        series=study.series,
        verdict=verdict,
        where=worst(places, _MOST_PLACES),
        machine_text=text,
        machine_fault=again.fault,
        of_runs=tuple(effects_of_runs(as_filed.experiment, filed.fitted)),
        rerun_rms=again.rms,
        next_experiment=None,
        left_out=tuple(sorted({c.name for c in every} & set(left_out))),
        advice=advice(verdict, _ADVICE),
        tried=tuple(dict.fromkeys(c.name for c in tried)),
        program=_program(study.experiment.machine),
        filed=None if filed is verdict else filed,
    )


def _program(rig: StatedMachine) -> Path | None:
    """The file of a model that is a program."""
    return rig.python and Path(rig.source.name).parent / rig.python[0]


def names(study: Study) -> frozenset[str]:
    """The names of all candidates."""
    own = {number.name for number in study.experiment.machine.numbers.values() if number.tolerance}
    return frozenset(own | {effect.name for effect in study.model.forms})
