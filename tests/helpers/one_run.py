"""An experiment of one run that a laser on axis 1 saw."""

import numpy as np

import mopro
from mopro.experiment.sawyer.trials import Experiment, Reading, Trial
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.source import Source

# A ripple of the tooth goes by in a quarter of a millisecond at full speed, so steps in
# time alone would beat with it, and in ten milliseconds, its swing, in the slow move.
PROGRAM = mopro.compile(
    "UU012500/1\nACC1 0.2\nVEL1 39.37\nMRI1 12.0\nWX1\nWT400\nVEL1 0.4\nMRI1 -0.2\nWX1\nWT400\n"
)
LASER = Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5)


def of(values, program=PROGRAM):
    """An experiment of one run that measured `values` (in)."""
    reading = Reading(LASER, np.arange(len(values)) / LASER.rate_hz, values)
    trial = Trial("run.csv", program, None, 0.0, (reading,))
    return Experiment(Source("x", ""), load_machine("chow1992"), (trial,), ())
