"""Wild samples: found, left out, and told."""

import math
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import names
from mopro.residuals.wild import repeated_samples, wild_samples

SIGMA = 0.1
SERVO = Servo()


@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_noise_has_wild_samples_in_one_series_of_a_thousand(scale):
    rng = np.random.default_rng(1)
    found = [wild_samples(scale * rng.standard_normal(500), scale % 4.0).any() for _ in range(2000)]
    assert sum(found) < 10


def test_a_sample_is_wild_that_stands_apart_on_whatever_slope():
    rng = np.random.default_rng(2)
    slope = np.linspace(-50.0, 50.0, 1000) + rng.standard_normal(1000)
    assert not wild_samples(slope, 1.0).any()
    slope[[10, 500]] += 12.0, -12.0
    assert np.flatnonzero(wild_samples(slope, 1.0)).tolist() == [10, 500]


def test_samples_between_two_jumps_are_wild_and_those_of_an_oscillation_are_not():
    rng = np.random.default_rng(6)
    t = np.arange(2000) / 1000
    moving = rng.standard_normal(2000) - 20.0 * t
    moving[300:312] -= 400.0
    moving[1500:1519] = 0.0
    expected = [*range(300, 312), *range(1500, 1519)]
    assert np.flatnonzero(wild_samples(moving, 1.0)).tolist() == expected
    ring = 300.0 * np.exp(-t / 0.05) * np.sin(2 * np.pi * 70.0 * t)
    assert not wild_samples(ring + rng.standard_normal(2000), 1.0).any()


def moving_with_rests(step=0.0):
    """Readings of an axis that goes to and fro with rests, with noise of 1, and its places.

    `step`: of the converter; its readings at rest are equal if it is coarse.
    """
    rng, t = np.random.default_rng(4), np.arange(4000) / 1000
    place = 500.0 * np.clip(np.abs(t % 2 - 1) * 1.5 - 0.25, 0.0, 1.0)
    seen = place + (0.0 if step > 5 else 1.0) * rng.standard_normal(4000)
    return (np.round(seen / step) * step if step else seen), place


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_readings_that_repeat_while_the_axis_moves_are_left_out(step):
    values, place = moving_with_rests(step)
    values[600:640] = values[599]
    values[1400:1420] = 0.0
    found = repeated_samples(values, values - place, 1.0)
    assert np.flatnonzero(found).tolist() == [*range(600, 640), *range(1400, 1420)]


@pytest.mark.parametrize("step", [0.0, 0.5, 10.0])
def test_readings_at_rest_and_those_of_a_coarse_converter_are_not_repeated(step):
    values, place = moving_with_rests(step)
    assert not repeated_samples(values, values - place, max(1.0, step / math.sqrt(12))).any()
    assert not repeated_samples(np.zeros(500), np.zeros(500), 1.0).any()


@pytest.mark.parametrize("truth", [{}, {"viscous": {"b": 1.0}}], ids=["nothing", "a drag"])
def test_a_sensor_that_sticks_hides_no_effect(truth):
    data = []
    for series in SERVO.measure(truth, SIGMA, 2):
        values = series.values.copy()
        for at in (100, 300):
            values[at : at + 8] = values[at - 1]
        data.append(replace(series, values=values))
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    assert names(verdict) == set(truth)
    assert verdict.remainder.variable == "sensor"
    assert any("repeated samples" in note for note in verdict.notes)


def test_a_shape_a_quiet_sensor_and_a_few_samples_have_no_wild_ones():
    rng = np.random.default_rng(3)
    spiky = rng.standard_normal(1000)
    spiky[::15] += 50.0
    steps = np.repeat([0.0, 30.0, 0.0], 300) + rng.standard_normal(900)
    # A sensor that sticks, and jumps to where it should be.
    sticking = rng.standard_normal(1000) - np.r_[np.zeros(500), np.arange(60.0), np.zeros(440)]
    still = np.zeros(1000)
    still[7] = 1.0
    shapes = [spiky, steps, sticking]
    for series, least in (*((s, 1.0) for s in shapes), (still, 0.0), (np.eye(1, 50)[0], 0.0)):
        assert not wild_samples(series, least).any()


@pytest.mark.parametrize("sigma", [SIGMA, None])
@pytest.mark.parametrize("truth", [{}, {"viscous": {"b": 1.0}}], ids=["nothing", "a drag"])
def test_wild_samples_are_left_out_and_told(truth, sigma):
    """Taken for noise, they would hide a drag of 1 N s/m, and make its interval useless."""
    data, at = [], np.random.default_rng(4)
    for series in SERVO.measure(truth, SIGMA, seed=5):
        values = series.values.copy()
        wild = at.choice(len(values), 4, replace=False)
        values[wild] += SIGMA * at.uniform(50.0, 500.0, 4)
        data.append(replace(series, values=values, sigma=sigma))
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == ("named" if truth else "none", set(truth))
    assert verdict.remainder.variable == "sensor"
    told = [note for note in verdict.notes if "4 wild samples" in note]
    assert len(told) == len(verdict.notes) == len(data)
    assert verdict.gap.after_rms == pytest.approx(SIGMA, rel=0.05)
    for effect in verdict.effects:
        low, high = effect.parameters["b"].ci95
        assert low < 1.0 < high < 1.3
