"""The periodogram over position."""

import numpy as np
import pytest

from mopro.diagnosis.statistics.spectrum import position_spectrum


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


def test_positions_within_the_finest_period_have_no_lines():
    x = np.linspace(0.0, 2e-5, 50)
    cycles, power = position_spectrum([x], [np.sin(x)], 1e-4)
    assert (len(cycles), len(power)) == (0, 0)
