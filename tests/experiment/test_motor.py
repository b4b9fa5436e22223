"""The motor as the diagnosis runs it, in steps that are as long as can be."""

import dataclasses
import math

import numpy as np
import pytest

import mopro
from mopro.diagnosis.fit import fit
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.signature import sought
from mopro.emulator.measured import Sensor
from mopro.experiment.catalogue import candidates
from mopro.experiment.model import Experiment, Reading, Trial
from mopro.experiment.motor import COARSE, FINE, Motor
from mopro.experiment.series import series_of
from mopro.machine import load_machine
from mopro.source import Source

# A ripple of the tooth goes by in a quarter of a millisecond at full speed, so steps in
# time alone would beat with it, and in ten milliseconds, its swing, in the slow move.
PROGRAM = mopro.compile(
    "UU012500/1\nACC1 0.2\nVEL1 39.37\nMRI1 12.0\nWX1\nWT400\nVEL1 0.4\nMRI1 -0.2\nWX1\nWT400\n"
)
LASER = Sensor("laser", "position", "position_1_in", 2000.0, 1, 2e-5)


def of(values):
    """An experiment of one run that measured `values` (in)."""
    reading = Reading(LASER, np.arange(len(values)) / LASER.rate_hz, values)
    trial = Trial("run.csv", PROGRAM, None, 0.0, (reading,))
    return Experiment(Source("x", ""), load_machine("chow1992"), (trial,), ())


def positions_um(settings, stepping):
    (seen,) = Motor(of(np.zeros(3200)), stepping)(settings)
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


@pytest.mark.parametrize("tau_s", [1e-6, 5e-5, 5e-4])
def test_a_lag_of_any_length_is_followed_in_long_steps(tau_s):
    """Behind by atan(ω tau)/k at a steady speed, ω = k ẋ; the source is the effect's own."""
    cruise = slice(480, 600)
    k = load_machine("chow1992").axis.wave_number_1_m
    expected_um = math.atan(k * 39.37 * 0.0254 * tau_s) / k * 1e6
    lag_um = positions_um({}, COARSE) - positions_um({"current_loop_lag": {"tau": tau_s}}, COARSE)
    assert lag_um[cruise].mean() == pytest.approx(expected_um, rel=0.01)


def test_a_period_is_found_under_a_sensor_that_bends():
    """A cyclic error is in the place itself; the bent reading would smear its line."""
    truth = {
        "sensor_nonlinearity": {"c3": 1e-3, "c5": 0.0, "mid": 0.0, "half": 0.254},
        "periodic_error": {"A": 2e-6, "lambda": 4.6e-4, "phi": 1.0},
    }
    seen = positions_um(truth, FINE) / 25400
    noisy = seen + 2e-5 * np.random.default_rng(0).standard_normal(len(seen))
    bent = truth["sensor_nonlinearity"]
    experiment = of(noisy)
    motor = Motor(experiment, COARSE)
    residuals = Residuals(motor, series_of(motor))
    base = fit(residuals, (), [{}])
    base = dataclasses.replace(base, settings={"sensor_nonlinearity": bent})
    (ripple,) = [c for c in candidates(motor) if c.name == "periodic_error"]
    groups = sought(residuals, base, ripple)
    strongest = max((group[0].values for group in groups), key=lambda values: values["A"])
    assert strongest["lambda"] == pytest.approx(4.6e-4, rel=1e-3)
    assert strongest["A"] == pytest.approx(2e-6, rel=0.1)
