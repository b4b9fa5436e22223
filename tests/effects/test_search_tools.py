"""The tools that searches share: lines, steps and delays in residuals."""

import types

import numpy as np
import pytest

from helpers.one_run import LASER
from mopro.diagnosis.model import ResidualView
from mopro.diagnosis.statistics.spectrum import sinusoid
from mopro.effects.search import delay_s, peaks, step

TIMES = np.arange(400) / LASER.rate_hz


def test_a_line_s_sizes_are_those_of_sine_and_cosine_beside_a_constant():
    angle = 40.0 * TIMES
    values = 2.0 * np.sin(angle) - 3.0 * np.cos(angle) + 7.0
    assert sinusoid(angle, values) == pytest.approx((2.0, -3.0))


def test_peaks_are_local_maxima_the_highest_first():
    assert peaks(np.array([9.0, 1.0, 3.0, 2.0, 5.0, 5.0, 0.0, 1.0])).tolist() == [5, 2]


def test_a_step_is_placed_between_the_samples_that_it_parts():
    noise = np.random.default_rng(1).standard_normal(len(TIMES))
    metres = 1e-6 * noise + np.where(TIMES[249] < TIMES, 5e-6, 0.0)
    before_s, after_s, height_m = step(metres / 1e-6, metres, TIMES)
    assert (before_s, after_s) == (TIMES[249], TIMES[250])
    assert height_m == pytest.approx(5e-6, abs=3e-7)
    assert step(noise, 1e-6 * noise, TIMES) is None


def test_a_delay_is_known_from_the_speed_at_which_it_shows():
    """The model's x(t) against data of x(t - d); one sample alone says nothing of it."""
    sigma, late_s = 1e-3, 5e-6
    x = np.sin(20.0 * TIMES)
    apart = np.sin(20.0 * (TIMES - late_s)) - x
    reading = types.SimpleNamespace(sensor=LASER, time_s=TIMES)
    single = types.SimpleNamespace(sensor=LASER, time_s=TIMES[:1])
    view = types.SimpleNamespace(positions=lambda: {0: (0, reading), 1: (1, single)})
    residuals = [(apart - apart.mean()) / sigma, np.array([99.0])]
    left = ResidualView((), residuals, [sigma, sigma], [x, x[:1]], {}, lambda settings: 0.0)
    found_s, error_s = delay_s(view, left)
    assert found_s == pytest.approx(late_s, rel=1e-3)
    speed = 20.0 * np.cos(20.0 * TIMES)
    assert error_s == pytest.approx(sigma / (speed.std() * np.sqrt(len(TIMES))), rel=1e-2)
