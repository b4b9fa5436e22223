"""Read and check an experiment file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mopro.experiment.check.consistency import check
from mopro.experiment.model import Experiment
from mopro.experiment.read.runs import read_experiment


def load_experiment(path: str | Path) -> Experiment:
    """Read the experiment in file `path` with all its data, and check them against the programs.

    Raises ModelError, SourceError, MotionError and DataError, each with all findings of
    its kind; units and columns are not guessed.
    """
    experiment = read_experiment(path)
    doubts = check(experiment)
    return replace(experiment, notes=(*experiment.notes, *doubts))
