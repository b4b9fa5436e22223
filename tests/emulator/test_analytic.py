"""The integrator against closed forms: the check cases of the nominal axis."""

import math

import numpy as np
import pytest

from mopro.emulator import kernel
from mopro.machine import load_machine

AXIS = load_machine("chow1992").axis
K, F0, M = AXIS.wave_number_1_m, AXIS.pull_out_force_N, AXIS.moving_mass_kg
PITCH, IN, LBF = AXIS.pitch_m, 0.0254, 4.4482216152605


def swing(x0, v0=0.0, *, acceleration=0.0, zeta=0.0, f0=F0, mass=M, until=0.2, knots=4001, h=20e-6):
    """Times and lag of an axis whose command starts at rest and accelerates evenly.

    In the command's own frame even acceleration is a static load of mass x acceleration.
    """
    times = np.linspace(0.0, until, knots)
    microstep = PITCH / 500
    damping = 2 * zeta * math.sqrt(K * f0 * M) / mass
    segment = [0.0], [0.0], [0.0], [acceleration / microstep], [0.0]
    x, v = np.zeros(knots), np.zeros(knots)
    x[0], v[0] = x0, v0
    rows, low, high = [0] * (knots - 1), np.zeros(knots), np.zeros(knots)
    kernel.integrate(
        times.tolist(), rows, *segment, K, f0 / mass, damping, microstep, False, h, 0.0,
        x, v, low, high,
    )  # fmt: skip
    return times, acceleration * times**2 / 2 - x, acceleration * times - v


def frequency_of(times, lag):
    """From upward crossings of zero, each placed between samples by a cubic through four."""
    at = np.flatnonzero((lag[:-1] < 0) & (lag[1:] >= 0))
    crossings = []
    for i in at[(at > 1) & (at < len(lag) - 3)]:
        t, y = times[i - 1 : i + 3], lag[i - 1 : i + 3]
        crossings.append(np.polynomial.Polynomial.fit(y, t, 3)(0.0))
    return (len(crossings) - 1) / (crossings[-1] - crossings[0])


def pendulum_frequency(amplitude):
    """f0 / AGM ratio: exact for F0 sin(k x), by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(K * amplitude / 2)
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.sqrt(K * F0 / M) / (2 * math.pi) * a


@pytest.mark.parametrize(
    ("amplitude_m", "expected_hz"), [(1e-9, 82.6895), (0.2e-3, 74.8364), (0.4e-3, 51.0491)]
)
def test_swing_frequency(amplitude_m, expected_hz):
    times, lag, _ = swing(amplitude_m)
    found = frequency_of(times, lag)
    assert found == pytest.approx(expected_hz, abs=5e-4)
    assert found == pytest.approx(pendulum_frequency(amplitude_m), rel=1e-6)


def test_static_load_of_10_newton():
    lag = math.asin(10 / F0) / K
    _, found, speed = swing(-lag, acceleration=10 / M)
    assert found == pytest.approx(14.5875e-6, abs=1e-10)
    assert np.abs(speed).max() < 1e-9


@pytest.mark.parametrize(
    ("acceleration_in_s2", "payload_kg", "expected_um"),
    [(250, 0.0, 23.6), (600, 0.0, 57.6), (250, 2.26796, 45.0), (600, 2.26796, 116.0)],
)
def test_steady_lag(acceleration_in_s2, payload_kg, expected_um):
    _, lag, _ = swing(
        0.0, acceleration=acceleration_in_s2 * IN, zeta=0.2, f0=25 * LBF,
        mass=M + payload_kg, until=0.3, knots=601,
    )  # fmt: skip
    assert lag[-1] * 1e6 == pytest.approx(expected_um, rel=0.005)


def test_pull_out_at_a_step_of_acceleration():
    """Undamped: the swing turns back below 0.7246 F0/m and runs away above it."""
    for share, holds in ((0.7246, True), (0.7247, False)):
        _, lag, _ = swing(0.0, acceleration=share * F0 / M, until=0.5, knots=1001)
        assert (lag.max() < PITCH / 2) == holds


def test_a_slip_ends_a_whole_number_of_pitches_away():
    for v0 in (0.4, 0.7, 1.0):
        _, lag, speed = swing(0.0, v0, zeta=0.03, until=1.0)
        pitches = lag[-1] / PITCH
        assert abs(round(pitches)) >= 1
        assert abs(pitches - round(pitches)) < 0.1
        assert abs(speed[-1]) < 1e-4


@pytest.mark.parametrize("zeta", [0.01, 0.03, 0.1])
def test_ring_down_has_the_set_damping_ratio(zeta):
    _, lag, _ = swing(1e-6, zeta=zeta, until=0.12, knots=12001)
    tops = np.flatnonzero((lag[1:-1] < lag[:-2]) & (lag[1:-1] <= lag[2:])) + 1
    decrement = np.log(lag[tops[0]] / lag[tops[-1]]) / (len(tops) - 1)
    found = decrement / math.hypot(2 * math.pi, decrement)
    assert found == pytest.approx(zeta, rel=1e-3)


def test_energy_stays_without_damping():
    _, lag, speed = swing(0.2e-3, until=1.0)
    energy = M * speed**2 / 2 + F0 / K * (1 - np.cos(K * lag))
    assert np.abs(energy / energy[0] - 1).max() < 1e-8


def test_rest_is_declared_within_a_nanometre_and_only_then():
    times = np.linspace(0, 2.0, 2001)
    x, v, low, high = (np.zeros(2001) for _ in range(4))
    x[0] = 50e-6
    damping = AXIS.drive_damping_N_s_m / M
    hold = [0.0], [0.0], [0.0], [0.0], [0.0]
    steps = kernel.integrate(
        times.tolist(), [0] * 2000, *hold, K, F0 / M, damping, PITCH / 500, True, 50e-6, 1e-9,
        x, v, low, high,
    )  # fmt: skip
    resting = np.flatnonzero(v[1:] == 0) + 1
    assert abs(x[-1]) < 1e-9
    assert 0.5 < times[resting[0]] < 0.9
    assert steps < 0.9 / 50e-6
    assert np.all(np.diff(resting) == 1)
