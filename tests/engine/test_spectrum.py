"""The periodogram over position."""

import numpy as np
import pytest

from mopro.engine.spectrum import position_spectrum


def test_white_noise_has_the_power_one():
    rng = np.random.default_rng(1)
    x, z = 0.2 * rng.random(20_000), rng.standard_normal(20_000)
    _, power = position_spectrum([x], [z], 1e-4)
    assert power.mean() == pytest.approx(1.0, abs=0.1)


def test_a_line_is_where_its_period_says():
    rng = np.random.default_rng(2)
    runs = [np.sort(0.2 * rng.random(5000)) for _ in range(2)]
    seen = [np.sin(2 * np.pi * x / 1.7e-3 + i) for i, x in enumerate(runs)]
    cycles, power = position_spectrum(runs, seen, 5e-4)
    assert 1 / cycles[np.argmax(power)] == pytest.approx(1.7e-3, rel=5e-3)
    assert power.max() == pytest.approx(2 * 5000 / 4, rel=0.1)


def test_periods_that_no_memory_resolves_are_not_looked_at():
    x = np.sort(np.random.default_rng(4).random(5000))
    cycles, power = position_spectrum([x], [np.sin(2 * np.pi * x / 0.05)], 1e-9)
    assert len(cycles) < 300_000
    assert 1 / cycles[np.argmax(power)] == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize("reach", [0.0, 2e-5])
def test_positions_within_the_finest_period_have_no_lines(reach):
    x = np.linspace(0.0, reach, 50)
    cycles, power = position_spectrum([x], [np.sin(x)], 1e-4)
    assert (len(cycles), len(power)) == (0, 0)


@pytest.mark.parametrize("period", [9.0, 37.0])
def test_positions_on_a_grid_show_no_period_below_two_steps(period):
    """A line of 1 / (1 - 1/9) steps looks like one of 9."""
    there = np.arange(0.0, 721.0)
    x = np.concatenate([there, there[::-1]])
    cycles, power = position_spectrum([x], [np.sin(2 * np.pi * x / period)])
    assert cycles.max() <= 0.5
    assert 1 / cycles[np.argmax(power)] == pytest.approx(period, rel=0.02)


def test_positions_of_a_motion_with_ramps_are_on_no_grid():
    t = np.linspace(0.0, 1.0, 3000)
    x = np.where(t < 0.5, t * t, t - 0.25)
    cycles, power = position_spectrum([x], [np.sin(2 * np.pi * x / 5e-4)])
    assert 1 / cycles[np.argmax(power)] == pytest.approx(5e-4, rel=5e-3)
