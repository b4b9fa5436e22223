"""Readings of a converter coarser than the noise: its rounding is neither noise nor a wave."""

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

RNG = np.random.default_rng
STEP = 0.0015
TEXT = """\
machine = "kinematic"
[inputs]
command = {{ column = "target_rad" }}
[[sensor]]
name = "encoder"
quantity = "angle"
column = "angle_rad"
adc_step = 0.0015
noise_rms = {noise}
"""


def slow(seed):
    """Times (s) and targets (rad) of a motion that takes many samples from count to count."""
    t = np.arange(0, 40, 0.02)
    return t, np.interp(t, np.linspace(0, 40, 9), RNG(seed).uniform(-0.08, 0.08, 9))


def verdict_of(folder, noise, moved=lambda t, x: x, runs=1, seed=1):
    text = TEXT.format(noise=noise)
    for nth in range(runs):
        t, x = slow(seed + nth)
        read = STEP * np.rint((moved(t, x) + 1e-4 * RNG(seed + nth).standard_normal(len(t))) / STEP)
        write(folder / f"{nth}.csv", {"time_s": t, "target_rad": x, "angle_rad": read})
        text += f'[[run]]\ndata = "{nth}.csv"\n'
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return open_experiment(folder / "experiment.toml").conclude().verdict


@pytest.mark.parametrize("noise", ['"unknown"', "1e-4"])
@pytest.mark.parametrize("seed", [1, 2])
def test_rounding_is_no_disagreement(tmp_path, noise, seed):
    verdict = verdict_of(tmp_path, noise, seed=seed)
    assert (verdict.verdict, verdict.effects, verdict.drafts) == ("none", (), ())


def late(t, x):
    return np.interp(t - 0.08, t, x)


@pytest.mark.parametrize("noise", ['"unknown"', "1e-4"])
def test_what_is_there_is_named_alone(tmp_path, noise):
    verdict = verdict_of(tmp_path, noise, late, runs=2)
    (effect,) = verdict.effects
    assert "delay" in (effect.name, *effect.indistinguishable_from)


def test_no_period_below_two_counts_is_named(tmp_path):
    verdict = verdict_of(tmp_path, "1e-3", seed=3)
    periods = [e.parameters["P"].value for e in verdict.effects if "P" in e.parameters]
    assert all(period >= 2 * STEP for period in periods)
