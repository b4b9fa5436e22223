"""The motor as the diagnosis runs it, in steps that are as long as can be."""

import numpy as np
import pytest

import mopro
from mopro.emulator.measured import Sensor
from mopro.experiment.model import Experiment, Reading, Trial
from mopro.experiment.motor import COARSE, FINE, Motor
from mopro.machine import load_machine
from mopro.source import Source

# A ripple of the tooth goes by in a quarter of a millisecond at full speed, so steps in
# time alone would beat with it, and in ten milliseconds, its swing, in the slow move.
PROGRAM = mopro.compile(
    "UU012500/1\nACC1 0.2\nVEL1 39.37\nMRI1 8.0\nWX1\nWT400\nVEL1 0.4\nMRI1 -0.2\nWX1\nWT400\n"
)
LASER = Sensor("laser", "position", "position_1_in", 2000.0, 1, 2e-5)


def positions_um(settings, stepping):
    stamps = np.arange(3200) / LASER.rate_hz
    reading = Reading(LASER, stamps, np.zeros_like(stamps))
    trial = Trial("run.csv", PROGRAM, None, 0.0, (reading,))
    machine = load_machine("chow1992")
    (seen,) = Motor(Experiment(Source("x", ""), machine, (trial,), ()), stepping)(settings)
    return seen * 25400


@pytest.mark.parametrize(
    "settings",
    [
        {"detent_force": {"Fd": 2.0, "phi": 0.0}},
        {"current_third_harmonic": {"s": 0.02}},
        {"coulomb_friction": {"Fc": 2.0}},
        {"current_loop_lag": {"tau": 5e-5}},
        {"voltage_saturation": {"Vb": 45.0}},
    ],
    ids=lambda settings: next(iter(settings)),
)
def test_long_steps_are_within_a_tenth_of_a_micrometre(settings):
    long, short = (positions_um(settings, stepping) for stepping in (COARSE, FINE))
    assert np.abs(long - short).max() < 0.1
    assert np.abs(short - positions_um({}, FINE)).max() > 1.0
