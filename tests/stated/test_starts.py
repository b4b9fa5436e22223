"""The start of a thermal node is fitted within the noise of its first reading, stated or not."""

import math

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment
from mopro.stated.simulation import BASE

OVEN = """\
kind = "thermal"
name = "two blocks"

[nodes]
near = "power - loss1 * (T - ambient)"
far = "-loss2 * (T - ambient)"

[base]
capacity = { value = 200, unit = "J/K", free = true, range = [20, 2000] }
loss1 = { value = 0.5, unit = "W/K", free = true, range = [0, 10] }
loss2 = { value = 0.5, unit = "W/K", free = true, range = [0, 10] }
"""
HEATED = """\
machine = "machine.toml"

[inputs]
power = { column = "power_W", hold = true }
"""
SENSOR = """
[[sensor]]
name = "{node}"
quantity = "temperature"
column = "{node}_C"
noise_rms = {noise}
zero = 0
"""


def oven(folder, *, sigma, seed, noise='"unknown"', runs=2, even=True):
    """An experiment on two blocks of which one is heated, and nothing is hidden."""
    rng = np.random.default_rng(seed)
    text = HEATED + "".join(SENSOR.format(node=n, noise=noise) for n in ("near", "far"))
    for run in range(runs):
        steps = np.full(300, 5.0) if even else rng.uniform(2.0, 9.0, 300)
        t = np.concatenate([[0.0], np.cumsum(steps)])
        power = np.where(t < t[150], 4.0 + 4.0 * run, 1.0)
        rise = np.zeros(len(t))
        for i, step in enumerate(steps.tolist()):
            share = math.exp(-0.7 * step / 240.0)
            rise[i + 1] = rise[i] * share + power[i] / 0.7 * (1 - share)
        near = 21.0 + rise + sigma * rng.standard_normal(len(t))
        far = 21.0 + sigma * rng.standard_normal(len(t))
        write(folder / f"{run}.csv", {"time_s": t, "power_W": power, "near_C": near, "far_C": far})
        text += f'\n[[run]]\ndata = "{run}.csv"\n'
    (folder / "machine.toml").write_text(OVEN, encoding="utf-8")
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return open_experiment(folder / "experiment.toml")


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_named_for_the_noise_of_a_first_reading(tmp_path, seed):
    """Fixed at one reading, all of a run would be off by the noise of that one."""
    verdict = oven(tmp_path, sigma=0.05, seed=seed).conclude().verdict
    assert (verdict.verdict, verdict.effects) == ("none", ())


@pytest.mark.parametrize("sigma", [0.002, 0.05, 0.5])
@pytest.mark.parametrize("even", [True, False])
def test_a_start_is_looked_for_within_the_noise_that_neighbours_show(tmp_path, sigma, even):
    parameters = oven(tmp_path, sigma=sigma, seed=5, even=even).system.base.parameters
    starts = [p for p in parameters if p.name.startswith("start of")]
    assert len(starts) == 4
    for p in starts:
        assert (p.high - p.low) / 2 == pytest.approx(6 * sigma, rel=0.3)
        assert p.low < 21.0 < p.high


@pytest.mark.parametrize(("stated", "within"), [(0.08, 0.48), (0.01, 0.3)])
def test_a_start_is_looked_for_within_stated_noise_or_the_neighbours_larger_one(
    tmp_path, stated, within
):
    parameters = oven(tmp_path, sigma=0.05, seed=5, noise=str(stated)).system.base.parameters
    for p in parameters:
        if p.name.startswith("start of"):
            assert (p.high - p.low) / 2 == pytest.approx(within, rel=0.15)


def test_slow_rows_are_integrated_as_closely_as_quick_ones(tmp_path):
    """Rows of a sixtieth of the time constant: by a method of second order 5e-5 off."""
    opened = oven(tmp_path, sigma=1e-4, seed=5, noise="0.01", runs=1)
    t = opened.system.experiment.trials[0].time_s[:151]
    true = {"loss1": 0.7, "loss2": 0.5, "capacity": 240.0}
    true |= {p.name: 21.0 for p in opened.system.base.parameters if p.name.startswith("start")}
    near = opened.system.model({BASE: true})[0][:151]
    assert near == pytest.approx(21.0 + 4.0 / 0.7 * (1 - np.exp(-0.7 * t / 240.0)), abs=2e-6)
