"""An experiment from its file, read and looked through."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mopro.experiment.check.consistency import check
from mopro.experiment.model import Experiment
from mopro.experiment.read.runs import read_experiment


def load_experiment(path: str | Path) -> Experiment:
    """The experiment in file `path` with all its data, which belong to their programs.

    Raises ModelError, SourceError, MotionError and DataError, each with all findings of
    its kind; nothing is guessed.
    """
    experiment = read_experiment(path)
    doubts = check(experiment)
    return replace(experiment, notes=(*experiment.notes, *doubts))
