"""Effects of a run's own time: a machine file states the runs that they were fitted on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from mopro.formula.written import WrittenEffect
from mopro.rig.data import RigExperiment, Run
from mopro.rig.model import AMBIENT


def of_one_run(effect: WrittenEffect, units: Mapping[str, str]) -> bool:
    """True for an effect that says nothing of runs that it was not fitted on.

    Its term is one of the time since that run began or, without an input `ambient` (`units` are
    those of the inputs), of how warm it was around then.
    """
    surroundings = effect.enters == AMBIENT and AMBIENT not in units
    return surroundings or "t" in effect.term.formula.names


def fitted_on(experiment: RigExperiment, effect: str) -> dict[str, str]:
    """The data files of the runs that have `effect`, each with its checksum."""
    return dict(run.data for run in experiment.trials if effect not in run.without)


def kept_to_their_runs(experiment: RigExperiment) -> RigExperiment:
    """The experiment with the effects that its machine has in certain runs off in all others.

    Such an effect is no part of the machine where none of those runs is here.
    """
    machine, trials, notes = experiment.machine, experiment.trials, experiment.notes
    for name, runs in machine.runs.items():
        others = [run.name for run in trials if not _is_of(run, runs)]
        if others:
            here = {run.data[0] for run in trials if run.name in others}
            files = ", ".join(f"another {file}" if file in here else file for file in runs)
            where = "here" if len(others) == len(trials) else f"in {', '.join(others)}"
            notes += (f"{name} of {machine.name} is left out {where}: it belongs to {files}",)
        if len(others) == len(trials):
            active = {n: own for n, own in machine.active.items() if n != name}
            machine = replace(machine, active=active)
        else:
            trials = tuple(
                replace(run, without=run.without | {name}) if run.name in others else run
                for run in trials
            )
    return replace(experiment, machine=machine, trials=trials, notes=notes)


def _is_of(run: Run, runs: Mapping[str, str]) -> bool:
    """True if the run's data are of one of the files `runs`, with their content as it was."""
    name, checksum = run.data
    return runs.get(name) == checksum
