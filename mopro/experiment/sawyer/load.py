"""Read and check an experiment file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mopro.experiment.sawyer.consistency import check
from mopro.experiment.sawyer.model import Experiment
from mopro.experiment.sawyer.runs import read_experiment
from mopro.machine import Machine
from mopro.machine.runs import left_out


def load_experiment(path: str | Path, machine: Machine | None = None) -> Experiment:
    """Read the experiment in file `path` with all its data, and check them against the programs.

    It is on `machine` if one is given, else on that of the file; data are checked with the latter.
    Raises ModelError, SourceError, MotionError and DataError, each with all findings of its kind;
    units and columns are not guessed.
    """
    experiment = read_experiment(path)
    doubts = check(experiment)
    machine = machine or experiment.machine
    off = left_out(machine.name, machine.runs, experiment.trials)
    return replace(experiment, machine=machine, notes=(*experiment.notes, *doubts, *off))
