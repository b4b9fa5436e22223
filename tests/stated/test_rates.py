"""Derivatives of sampled positions against those of known functions."""

import numpy as np
import pytest

from mopro.stated.rates import Rates, derivative

RNG = np.random.default_rng


def times(even, count=400, interval_s=0.01, seed=3):
    t = interval_s * np.arange(count)
    return t if even else t + 0.3 * interval_s * RNG(seed).uniform(-1, 1, count)


def swing(t, w=9.0):
    """Position, speed and acceleration."""
    return np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("width", [2, 5, 9])
def test_a_polynomial_of_degree_four_has_its_own_derivatives(even, width):
    t = times(even, 60)
    own = np.polynomial.Polynomial([2.0, -1.0, 3.0, 0.5, -4.0])
    for order in (1, 2):
        found = derivative(t, width, order)(own(t))
        assert found == pytest.approx(own.deriv(order)(t), abs=2e-8)


@pytest.mark.parametrize("even", [True, False])
def test_a_swing_without_noise_is_followed_far_better_than_by_central_differences(even):
    t = times(even)
    x, v, a = swing(t)
    rates = Rates.of(t, x)
    by_differences = np.gradient(np.gradient(x, t), t)
    assert np.std(rates.velocity(x) - v) < 1e-3 * np.std(np.gradient(x, t) - v) + 1e-4
    assert np.std(rates.second(x) - a) < 0.1 * np.std(by_differences - a)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("noise", [1e-5, 1e-4, 1e-3])
def test_noise_of_the_position_widens_what_is_fitted(even, noise):
    """Within twice the error of the best of all widths, which nobody knows beforehand."""
    t = times(even, 4000, 0.001)
    x, _, a = swing(t)
    seen = x + noise * RNG(1).standard_normal(len(t))
    errors = [np.std(derivative(t, w, 2)(seen) - a) for w in (2, 3, 4, 6, 8, 12, 16, 24, 32)]
    assert np.std(Rates.of(t, seen).second(seen) - a) < 2 * min(errors)


@pytest.mark.parametrize("level", [0.0, 7.3, -1e4])
def test_an_axis_at_rest_has_no_speed_also_beside_its_moves(level):
    t = times(True)
    x = level + np.clip(t - 1.0, 0.0, 1.0) ** 2
    v = Rates.of(t, x).velocity(x)
    moving = (t > 1.0) & (t < 2.0)
    assert np.all(v[t < 0.985] == 0)
    assert np.all(v[t > 2.015] == 0)
    assert np.all(v[moving] > 0)
    assert np.all(v >= -1e-9 * max(1.0, abs(level)))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_a_few_rows_have_rates(count):
    t = times(True, count)
    rates = Rates.of(t, 3.0 * t)
    assert rates.velocity(3.0 * t) == pytest.approx(np.full(count, 3.0 if count > 1 else 0.0))
    assert rates.second(3.0 * t) == pytest.approx(np.zeros(count), abs=1e-9)


def test_no_polynomial_goes_over_a_gap():
    t = np.concatenate([times(True, 200), 30 + times(True, 200)])
    x, v, _ = swing(t)
    x = x + np.where(t > 10, 500.0, 0.0)
    assert Rates.of(t, x).velocity(x) == pytest.approx(v, abs=0.02)
