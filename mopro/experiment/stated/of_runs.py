"""Effects of a run's own time: a machine file states the runs that they were fitted on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from mopro.engine.verdict import Named
from mopro.formula.written import WrittenEffect
from mopro.machine.runs import files_of, known_off, left_out, others
from mopro.stated.data import StatedExperiment
from mopro.stated.model import AMBIENT


def of_one_run(effect: WrittenEffect, units: Mapping[str, str]) -> bool:
    """True for an effect that says nothing of runs that it was not fitted on.

    Its term is one of the time since that run began or, without an input `ambient` (`units` are
    those of the inputs), of how warm it was around then.
    """
    surroundings = effect.enters == AMBIENT and AMBIENT not in units
    return surroundings or "t" in effect.term.formula.names


def fitted_on(experiment: StatedExperiment, effect: Named) -> dict[str, str]:
    """The data files of the runs that have `effect`, each with its checksum."""
    return files_of([
        run
        for run in experiment.trials
        if effect.name not in run.without and effect.run in (None, run.name)
    ])  # fmt: skip


def kept_to_their_runs(experiment: StatedExperiment) -> StatedExperiment:
    """The experiment with the effects that its machine has in certain runs off in all others.

    Such an effect is no part of the machine where none of those runs is here.
    """
    machine, trials = experiment.machine, experiment.trials
    notes = (*experiment.notes, *left_out(machine.name, machine.runs, trials))
    active = {
        name: own
        for name, own in machine.active.items()
        if name not in machine.runs or len(others(machine.runs[name], trials)) < len(trials)
    }
    kept = tuple(
        replace(run, without=run.without | off)
        for run, off in zip(trials, known_off(machine.runs, trials), strict=True)
    )
    return replace(experiment, machine=replace(machine, active=active), trials=kept, notes=notes)
