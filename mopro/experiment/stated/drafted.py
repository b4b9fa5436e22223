"""An experiment with the drafts of a verdict among the effects of its machine."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.verdict import Verdict
from mopro.experiment.conclude.drafts import filed
from mopro.experiment.stated.study import Study
from mopro.formula.entry import read_effects
from mopro.stated.file import HOSTS
from mopro.stated.names import unlisted_of
from mopro.stated.simulation import Model
from mopro.tomlfile import Document


def drafted(study: Study, verdict: Verdict) -> tuple[Study, Verdict]:
    """The study and the verdict with those drafts that the machine's equations can have.

    Others, such as a step in the readings of one run, are none of the machine.
    """
    experiment = study.experiment
    found = filed(verdict, {effect.name: effect for effect in unlisted_of(experiment)})
    if found is None:
        return study, verdict
    text, wider = found
    host = HOSTS[experiment.machine.kind]
    stated = Document(text).read(lambda root: read_effects(root, host))
    experiment = replace(experiment, machine=experiment.machine.beside(stated))
    model = Model(experiment, foreign=study.model.foreign)
    return replace(study, experiment=experiment, model=model), wider
