"""One effect that looks like two others together is told by its own name."""

import dataclasses

import numpy as np
import pytest

import mopro
from helpers.one_run import LASER, of
from mopro.engine import reconcile
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import COARSE, FINE, ForwardModel
from mopro.experiment.sawyer.system import series_of

STROKES = mopro.compile("UU012500/1\nVEL1 5.0\nACC1 0.1\n" + 4 * "MRI1 3.0\nWX1\nWT300\n")
COARSER = dataclasses.replace(LASER, noise_rms=1e-4)


def measured(truth, sensor, seed=1):
    """An experiment of one run with `truth` in it."""
    (clean,) = ForwardModel(of(np.zeros(7400), STROKES), FINE)(truth)
    noise = sensor.noise_rms * np.random.default_rng(seed).standard_normal(len(clean))
    experiment = of(clean + noise, STROKES)
    (trial,) = experiment.trials
    readings = (dataclasses.replace(trial.readings[0], sensor=sensor),)
    return dataclasses.replace(experiment, trials=(dataclasses.replace(trial, readings=readings),))


@pytest.mark.parametrize("sensor", [LASER, COARSER], ids=["fine", "coarse"])
@pytest.mark.parametrize("e", [-0.18, -0.14, 0.15, 0.19])
def test_a_weaker_motor_is_no_heavier_one_that_is_damped_otherwise(e, sensor):
    """Both are as late and ring as slowly; how long they ring takes a second effect."""
    motor = ForwardModel(measured({"force_constant": {"e": e}}, sensor), COARSE)
    names = ("payload_mass", "electrical_damping", "force_constant")
    catalogue = [c for c in candidates(motor) if c.name in names]
    verdict = reconcile(motor, catalogue, series_of(motor))
    assert [effect.name for effect in verdict.effects] == ["force_constant"]
    assert verdict.effects[0].parameters["e"].value == pytest.approx(e, abs=0.01)
