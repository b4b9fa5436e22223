"""The tools that searches share: lines, steps and delays in residuals."""

import types

import numpy as np
import pytest
from scipy.signal import lsim, lti

from helpers.one_run import LASER
from mopro.effects.starts import delay_s, force_N, peaks, residual_m, step, strongest_lines
from mopro.engine.candidate import ResidualView
from mopro.engine.spectrum import sinusoid
from mopro.machine import load_machine

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
    left = ResidualView(
        (), residuals, [sigma, sigma], [x, x[:1]], [], {}, lambda _: 0.0, lambda _: np.zeros(1)
    )
    found_s, error_s = delay_s(view, left)
    assert found_s == pytest.approx(late_s, rel=1e-3)
    speed = 20.0 * np.cos(20.0 * TIMES)
    assert error_s == pytest.approx(sigma / (speed.std() * np.sqrt(len(TIMES))), rel=1e-2)


def driven_by_a_force_over_the_place(force_N, period_m, payload_kg):
    """A view of a motor that speeds up to 0.4 m/s, and its residual beside noise of 0.1 um.

    The answer of the mass on the drive's spring and damper to the force is SciPy's.
    """
    machine, sigma_m = load_machine("chow1992"), 1e-7
    time_s = np.arange(4000) / 2000
    x = 0.1 * time_s**2
    axis = machine.axis
    motor = lti([1.0], [
        axis.moving_mass_kg + payload_kg, axis.drive_damping_N_s_m, axis.stiffness_N_m,
    ])  # fmt: skip
    _, moved, _ = lsim(motor, force_N * np.sin(2 * np.pi * x / period_m + 0.4), time_s)
    residual = moved - moved.mean() + sigma_m * np.random.default_rng(2).standard_normal(len(x))
    sensor = types.SimpleNamespace(unit_si=1.0)
    reading = types.SimpleNamespace(sensor=sensor, time_s=time_s)
    view = types.SimpleNamespace(
        machine=machine, runs=[types.SimpleNamespace(payload_kg=payload_kg)],
        positions=lambda: {0: (0, reading)}, targets=lambda settings: [x],
    )  # fmt: skip
    left = ResidualView(
        (), [residual / sigma_m], [sigma_m], [x], [], {}, lambda _: 0.0, lambda _: np.zeros(1)
    )
    return view, left


@pytest.mark.parametrize("payload_kg", [0.0, 1.5])
def test_the_period_of_a_force_is_that_of_the_force_and_not_of_the_resonance(payload_kg):
    view, left = driven_by_a_force_over_the_place(2.0, 1e-3, payload_kg)
    ((sine, cosine, period_m),) = strongest_lines(view, left, 1e-4, 1, of=force_N)
    assert period_m == pytest.approx(1e-3, rel=0.002)
    assert np.hypot(sine, cosine) == pytest.approx(2.0, rel=0.2)
    assert np.arctan2(cosine, sine) == pytest.approx(0.4, abs=0.5)
    # The residual itself is strongest where the motor resonates, at another place.
    ((*_, of_residual_m),) = strongest_lines(view, left, 1e-4, 1, of=residual_m)
    assert abs(of_residual_m / 1e-3 - 1) > 0.01


def test_a_line_does_not_depend_on_the_units_of_the_sensors():
    """A line over place, of a sensor in metres and one in inches: weights are 1/sigma in metres."""
    time_s = np.arange(2000) / 2000
    x = 0.02 * time_s
    noise = np.random.default_rng(3).standard_normal((2, len(x)))
    sigmas_m = (1e-7, 2e-6)
    waves = (2e-7 * np.sin(2 * np.pi * x / 1e-3), 2e-6 * np.sin(2 * np.pi * x / 4e-4))
    residuals = [
        (wave + sigma * own) / sigma
        for wave, sigma, own in zip(waves, sigmas_m, noise, strict=True)
    ]

    def periods(*units_si):
        readings = [
            types.SimpleNamespace(sensor=types.SimpleNamespace(unit_si=unit), time_s=time_s)
            for unit in units_si
        ]
        view = types.SimpleNamespace(
            positions=lambda: {i: (0, reading) for i, reading in enumerate(readings)},
            targets=lambda settings: [x / unit for unit in units_si],
        )
        sigmas = [sigma / unit for sigma, unit in zip(sigmas_m, units_si, strict=True)]
        left = ResidualView((), residuals, sigmas, [], [], {}, lambda _: 0.0, lambda _: np.zeros(1))
        return [period_m for *_, period_m in strongest_lines(view, left, 1e-4, 2)]

    in_metres = periods(1.0, 1.0)
    assert in_metres[0] == pytest.approx(1e-3, rel=0.02)
    assert periods(1.0, 0.0254) == pytest.approx(in_metres)
    assert periods(0.0254, 1.0) == pytest.approx(in_metres)
