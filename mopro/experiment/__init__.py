"""Experiments: measured data beside the program and the machine that they came from."""

from mopro.experiment.sawyer.system import load_experiment
from mopro.experiment.sawyer.trials import Experiment, LoggedCommand, Reading, SteadyTable, Trial

__all__ = [
    "Experiment",
    "LoggedCommand",
    "Reading",
    "SteadyTable",
    "Trial",
    "load_experiment",
]
