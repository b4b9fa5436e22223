"""The response of a first-order lag, against closed forms."""

import numpy as np
import pytest

from mopro.plant.measurement import first_order

INTERVAL_S = 5e-4


@pytest.mark.parametrize("lag_s", [5e-5, 1.6e-4, 3e-3, 0.5])
def test_a_parabola_is_followed_exactly(lag_s):
    """y' = (a t²/2 - y)/τ from rest: y = a t²/2 - a τ t + a τ² (1 - exp(-t/τ))."""
    t = INTERVAL_S * np.arange(400)
    expected = t**2 / 2 - lag_s * t - lag_s**2 * np.expm1(-t / lag_s)
    assert first_order(INTERVAL_S, t**2 / 2, lag_s) == pytest.approx(expected, abs=1e-12)


def test_a_sine_is_later_and_smaller_by_theory():
    """1/√(1 + (ωτ)²) and atan ωτ, long after the start."""
    lag_s, omega = 1.6e-4, 2 * np.pi * 80
    t = INTERVAL_S * np.arange(4000)
    seen = first_order(INTERVAL_S, np.sin(omega * t), lag_s)[2000:-1]
    size, late = 1 / np.hypot(1, omega * lag_s), np.arctan(omega * lag_s)
    assert seen == pytest.approx(size * np.sin(omega * t - late)[2000:-1], abs=1e-4)


@pytest.mark.parametrize("values", [[3.0], [3.0, 3.0], [3.0, 3.0, 3.0]])
def test_what_stands_still_is_seen_as_it_is(values):
    assert first_order(INTERVAL_S, np.array(values), 1e-3).tolist() == pytest.approx(values)
