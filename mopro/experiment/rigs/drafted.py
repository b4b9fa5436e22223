"""An experiment with the drafts of a verdict among the effects of its machine."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.verdict import Verdict
from mopro.experiment.conclude.drafts import section, with_drafts
from mopro.experiment.rigs.study import Study
from mopro.formula.entry import read_effects
from mopro.rig.file import HOSTS
from mopro.rig.names import unlisted_of
from mopro.rig.simulation import Model
from mopro.source import Source
from mopro.tomlfile import Document


def drafted(study: Study, verdict: Verdict) -> tuple[Study, Verdict]:
    """The study and the verdict with those drafts that the machine's equations can have.

    Others, such as a step in the readings of one run, are none of the machine.
    """
    experiment = study.experiment
    known = {effect.name: effect for effect in unlisted_of(experiment)}
    taken = [draft for draft in verdict.drafts if draft.run is None and draft.name in known]
    if not taken:
        return study, verdict
    lines = [line for draft in taken for line in section(draft, known[draft.name])]
    host = HOSTS[experiment.machine.kind]
    stated = Document(Source("drafts", "\n".join(lines))).read(
        lambda root: read_effects(root, host)
    )
    machine = experiment.machine.beside(stated)
    wider = replace(experiment, machine=machine)
    model = Model(wider, foreign=study.model.foreign)
    own = {draft.name: known[draft.name] for draft in taken}
    return replace(study, experiment=wider, model=model), with_drafts(verdict, own)
