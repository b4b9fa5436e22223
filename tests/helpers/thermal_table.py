"""The source's table of final temperatures, as programs/thermal has it."""

import csv

import numpy as np

from helpers.paths import PROGRAMS
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.trials import Experiment, SteadyTable
from mopro.machine import load_machine
from mopro.source import Source

MACHINE = load_machine("chow1992")
INCH = 0.0254
AIR = 24.87
CYCLE_M = 1.016e-3


def source_table():
    """The table of programs/thermal: an array of numbers for each column."""
    with open(PROGRAMS / "thermal" / "table-3-2.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def table(rise=None, noise=1.0, rows=slice(None)):
    columns = source_table()
    v, a, x, y = (
        columns[name][rows] * INCH
        for name in ("velocity_in_s", "acceleration_in_s2", "x_in", "y_in")
    )
    measured = columns["temperature_rise_C"][rows] if rise is None else rise
    return SteadyTable("table-3-2.csv", v, a, x, y, measured, noise)


def offered():
    """The candidates of an experiment that is the table alone."""
    return candidates(ForwardModel(Experiment(Source("e.toml", ""), MACHINE, (), (table(),))))
