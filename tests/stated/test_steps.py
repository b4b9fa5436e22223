"""Steps of integration: what they leave is little beside the noise of the readings."""

import numpy as np
import pytest
from scipy.linalg import expm

from helpers.stated import write
from mopro.experiment.opened import open_experiment

MACHINE = """\
kind = "axis"
name = "mine"
unit = "mm"
[base]
mass = { value = 1, unit = "kg" }
viscous = { value = 4, unit = "N s/m", free = true, range = [0.1, 60] }
spring = { value = 1500, unit = "N/m" }
"""
EXPERIMENT = """\
machine = "machine.toml"
[inputs]
force = { column = "force_N", hold = true }
[[sensor]]
name = "position"
column = "position_mm"
quantity = "position"
zero = 0
noise_rms = 0.05
[[run]]
data = "run.csv"
start = { x = 0, v = 0 }
"""


def swung(force_N, dt, stiffness, mass=1.0, viscous=4.0):
    """Positions (m) of a mass on a spring under forces that hold for `dt`, by their closed form."""
    law = np.array([[0, 1, 0], [-stiffness / mass, -viscous / mass, 1 / mass], [0, 0, 0]])
    step, state, found = expm(law * dt), np.zeros(3), []
    for force in force_N:
        found.append(state[0])
        state[2] = force
        state = step @ state
    return np.array(found)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_the_interval_of_a_spring_holds_where_readings_are_few_to_a_swing(tmp_path, seed):
    """Eight readings in a swing: the steps that the readings have are off by a standard error."""
    rng, dt = np.random.default_rng(seed), 1 / 60
    force = np.repeat(rng.uniform(-40, 40, 60), 10)
    x = 1e3 * swung(force, dt, 2500.0) + 0.05 * rng.standard_normal(len(force))
    columns = {"time_s": dt * np.arange(len(force)), "force_N": force, "position_mm": x}
    write(tmp_path / "run.csv", columns)
    (tmp_path / "machine.toml").write_text(MACHINE, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    (effect,) = verdict.effects
    assert (verdict.verdict, effect.name) == ("named", "stiffness")
    low, high = effect.parameters["k"].ci95
    assert low < 1000 < high
