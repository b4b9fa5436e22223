"""Wild samples: found, left out, and told."""

import math
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import names
from mopro.engine.residuals.wild import (
    repeated_samples,
    wild_samples,
    without_rough_ends,
    without_wild,
)
from mopro.engine.series import Series

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
    slope[[0, 10, 500, 999]] += 12.0, 12.0, -12.0, -12.0
    assert np.flatnonzero(wild_samples(slope, 1.0)).tolist() == [0, 10, 500, 999]


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


@pytest.mark.parametrize("frequency_Hz", [20, 70, 150, 200, 250])
@pytest.mark.parametrize("begun", [0, 500])
def test_the_peaks_of_a_ring_are_not_wild_at_whatever_frequency_and_phase(frequency_Hz, begun):
    """At 1 kHz, down to four samples a cycle, as long as it is well above the noise.

    Where it begins within the record its first samples may stand apart.
    """
    rng, t = np.random.default_rng(7), np.arange(2000) / 1000
    for phase in np.linspace(0.0, 2 * np.pi, 12, endpoint=False):
        ring = 300.0 * np.exp(-t / 0.05) * np.cos(2 * np.pi * frequency_Hz * t + phase)
        series = np.r_[np.zeros(begun), ring] + rng.standard_normal(begun + 2000)
        found = wild_samples(series, 1.0)[begun : begun + 100]
        assert found.sum() <= (2 if begun or frequency_Hz > 150 else 0)


def test_what_decays_from_the_first_sample_on_is_not_wild():
    rng = np.random.default_rng(8)
    for ratio in (0.5, 0.7, 0.9):
        decay = 300.0 * ratio ** np.arange(500.0) + rng.standard_normal(500)
        assert not wild_samples(decay, 1.0).any()
        assert not wild_samples(decay[::-1], 1.0).any()


def left_out(measured, predicted, sigma=1.0):
    """The samples that are left out as an end, of readings in mm, and the notes."""
    series, notes = without_rough_ends(
        Series("run", "probe", "mm", measured, sigma), measured - predicted
    )
    return np.flatnonzero(~series.counted).tolist(), notes


@pytest.mark.parametrize("sigma", [1.0, None])
def test_the_samples_beyond_a_jump_near_an_end_are_left_out(sigma):
    rng = np.random.default_rng(9)
    place = 300.0 * np.sin(np.arange(1000) / 50)
    measured = place + rng.standard_normal(1000)
    assert left_out(measured, place, sigma) == ([], [])
    measured[:4] = 0.0
    measured[0] = 80.0
    measured[-7:] = 1e6
    ends, notes = left_out(measured, np.zeros(1000), sigma)
    assert ends == [0, 1, 2, 3, *range(993, 1000)]
    assert notes == ["probe in run has 11 wild samples, the first at sample 1: left out"]


@pytest.mark.parametrize("at", [4, 996])
def test_a_jump_that_the_model_predicts_by_half_is_no_rough_end(at):
    """A step of the command near an end, a sensor that tells it at once, and a wrong gain."""
    rng = np.random.default_rng(10)
    step = np.where(np.arange(1000) < at, 0.0, 200.0)
    noise = rng.standard_normal(1000)
    assert left_out(1.3 * step + noise, step) == ([], [])
    ends, _ = left_out(1.3 * step + noise, 0 * step)
    assert len(ends) == 4


def test_a_reading_that_flips_by_one_step_of_its_converter_is_not_wild():
    """A slow temperature, read in steps of 0.32 K with less noise than that, of unknown size."""
    rng, t = np.random.default_rng(12), np.arange(900.0)
    place = 24.0 + 35.0 * (1.0 - np.exp(-t / 180.0))
    read = 0.32 * np.round((place + 0.04 * rng.standard_normal(900)) / 0.32)
    series = Series("run", "probe", "K", read, None)
    for without in (without_rough_ends, without_wild):
        left, notes = without(series, read - place)
        assert left is series
        assert not notes
    read[[0, 450]] += 1.6
    for without, found in ((without_rough_ends, [0]), (without_wild, [0, 450])):
        left, _ = without(replace(series, values=read), read - place)
        assert np.flatnonzero(~left.counted).tolist() == found


def test_a_jump_within_the_record_and_the_ends_of_a_short_one_count():
    rng = np.random.default_rng(11)
    step = np.where(np.arange(1000) < 11, 0.0, 200.0) + rng.standard_normal(1000)
    assert left_out(step, np.zeros(1000)) == ([], [])
    assert left_out(step[10:109], np.zeros(99)) == ([], [])


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


@pytest.mark.parametrize("truth", [{}, {"viscous": {"b": 1.0}}], ids=["nothing", "a drag"])
@pytest.mark.parametrize("count", [1, 3])
def test_the_ends_of_a_record_decide_nothing(truth, count):
    """The first or the last readings are wrong: nothing is named for them, and nothing hidden."""
    data = list(SERVO.measure(truth, SIGMA, seed=5))
    for i, ends in ((0, slice(count)), (1, slice(-count, None))):
        values = data[i].values.copy()
        values[ends] += 30.0 * SIGMA
        data[i] = replace(data[i], values=values)
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == ("named" if truth else "none", set(truth))
    assert len(verdict.notes) == 2
