"""Experiments: measured data beside the program and the machine that they came from."""

from mopro.experiment.sawyer.model import Experiment, LoggedCommand, Reading, SteadyTable, Trial
from mopro.experiment.sawyer.system import load_experiment

__all__ = [
    "Experiment",
    "LoggedCommand",
    "Reading",
    "SteadyTable",
    "Trial",
    "load_experiment",
]
