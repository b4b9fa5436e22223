"""The plant against closed forms: the check cases, and what they do not cover."""

import numpy as np
import pytest

from helpers.closed_forms import (
    AXIS,
    CASES,
    integrated,
    pendulum_frequency,
    ring_down_zeta,
    swing_frequency,
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_check_cases(case):
    assert case.got() == pytest.approx(case.expected, abs=case.tolerance)


@pytest.mark.parametrize("amplitude_m", [1e-9, 0.2e-3, 0.4e-3])
def test_swing_frequency_is_the_pendulums(amplitude_m):
    assert swing_frequency(amplitude_m) == pytest.approx(pendulum_frequency(amplitude_m), rel=1e-6)


@pytest.mark.parametrize("zeta", [0.01, 0.1])
def test_ring_down_has_the_set_damping_ratio(zeta):
    assert ring_down_zeta(zeta) == pytest.approx(zeta, rel=1e-3)


def test_rest_is_declared_within_a_nanometre_and_only_then():
    times = np.linspace(0, 2.0, 2001)
    damping = AXIS.drive_damping_N_s_m
    steps, x, v = integrated(times, 50e-6, 0.0, damping=damping, h=50e-6, rest_m=1e-9)
    resting = np.flatnonzero(v[1:] == 0) + 1
    assert abs(x[-1]) < 1e-9
    assert 0.5 < times[resting[0]] < 0.9
    assert steps < 0.9 / 50e-6
    assert np.all(np.diff(resting) == 1)
