"""A signal that holds each value up to the next sample, behind a delay or a lag."""

from itertools import pairwise

import numpy as np
import pytest

from helpers.stated import DRIVEN, write
from mopro.experiment.opened import open_experiment
from mopro.formula.signals import held_delayed, held_lag

RNG = np.random.default_rng(3)
T = np.cumsum(RNG.uniform(0.005, 0.015, 60))
U = RNG.standard_normal(60)
FINE = 20_000


def held(at):
    """The signal at any time, its first value before it begins."""
    return U[np.clip(np.searchsorted(T, at, side="right") - 1, 0, len(U) - 1)]


def told(lines):
    """Mean and slope of the lines between samples."""
    begin, end = (own[:-1] for own in lines)
    return (begin + end) / 2, end - begin


def expected(signal):
    """Mean and slope of a line of the same mean and first moment, by sums over fine steps."""
    means, slopes = [], []
    for begin, end in pairwise(T):
        share = (np.arange(FINE) + 0.5) / FINE
        values = signal(begin + share * (end - begin))
        means.append(values.mean())
        slopes.append(12 * np.mean((share - 0.5) * values))
    return np.array(means), np.array(slopes)


@pytest.mark.parametrize("delay_s", [0.0, 0.0037, 0.02, -0.006, 0.123])
def test_a_delay_moves_the_steps_within_the_samples(delay_s):
    mean, slope = expected(lambda at: held(at - delay_s))
    found = told(held_delayed(T, U, delay_s))
    # A step is within a fine step of where it is.
    assert found[0] == pytest.approx(mean, abs=10 / FINE)
    assert found[1] == pytest.approx(slope, abs=60 / FINE)


@pytest.mark.parametrize("tau_s", [1e-4, 0.02, 1.0, 1e5])
def test_a_lag_decays_within_the_samples(tau_s):
    at_samples = [U[0]]
    for value, step_s in zip(U, np.diff(T), strict=False):
        at_samples.append(value + (at_samples[-1] - value) * np.exp(-step_s / tau_s))

    def lagging(at):
        i = np.searchsorted(T, at, side="right") - 1
        return U[i] + (np.array(at_samples)[i] - U[i]) * np.exp(-(at - T[i]) / tau_s)

    mean, slope = expected(lagging)
    found = told(held_lag(T, U, tau_s))
    assert found[0] == pytest.approx(mean, abs=1e-5)
    assert found[1] == pytest.approx(slope, abs=1e-4)


def test_no_lag_is_the_signal():
    assert all(own is U for own in held_lag(T, U, 0.0))


MASS = """\
kind = "axis"
name = "puck"
unit = "mm"
[base]
mass = { value = 2.0, unit = "kg" }
"""


@pytest.mark.parametrize(
    ("effect", "settings"), [("input_delay", {"d": 0.0237}), ("input_lag", {"tau": 0.013})]
)
def test_a_mass_is_where_its_force_has_pushed_it(tmp_path, effect, settings):
    """A free mass under a held force of rows of 10 ms: closed form at each row."""
    t = np.arange(200) * 0.01
    force = RNG.uniform(-40, 40, 200)
    columns = {"time_s": t, "force_N": force, "position_mm": np.sin(t)}
    write(tmp_path / "run.csv", columns)
    (tmp_path / "machine.toml").write_text(MASS, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(DRIVEN, encoding="utf-8")
    model = open_experiment(tmp_path / "experiment.toml").system.model
    (found,) = model({effect: settings})
    fine = np.arange(0, 1.99, 1e-5) + 0.5e-5
    row = np.minimum((fine / 0.01 + 1e-9).astype(int), 199)
    if effect == "input_delay":
        row = np.clip(np.floor((fine - 0.0237) / 0.01).astype(int), 0, 199)
        pushed = force[row]
    else:
        kept, behind = np.exp(-0.01 / 0.013), [force[0]]
        for value in force[:-1].tolist():
            behind.append(value + (behind[-1] - value) * kept)
        pushed = force[row] + (np.array(behind)[row] - force[row]) * np.exp(
            -(fine - 0.01 * row) / 0.013
        )
    speed = np.cumsum(pushed / 2.0) * 1e-5
    place_mm = 1e3 * np.cumsum(speed - pushed / 4.0 * 1e-5) * 1e-5
    assert found[-1] == pytest.approx(place_mm[-1], abs=1e-2)
    assert np.max(np.abs(found[1:] - place_mm[999::1000])) < 1e-2
