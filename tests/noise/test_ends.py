"""Readings at the end of a range are told from rests, in noise and without it."""

import numpy as np
import pytest

from mopro.noise import ends_of

RATE_HZ = 100.0
TIMES = np.arange(1200) / RATE_HZ


def trapezoids(height):
    """Moves to `height` and back with sudden starts and stops, and rests at both ends."""
    return np.interp(TIMES % 6, [0, 1, 2.5, 3.5, 5, 6], [0, 0, height, height, 0, 0])


def smooth(height):
    u = np.clip(np.interp(TIMES % 6, [0, 1, 2.5, 3.5, 5, 6], [0, 0, 1, 1, 0, 0]), 0, 1)
    return height * (3 * u**2 - 2 * u**3)


def swing(height):
    return height * np.sin(2 * np.pi * 0.5 * TIMES)


def noise(rms, memory, seed):
    white = np.random.default_rng(seed).normal(size=len(TIMES)) * rms
    for n in range(1, len(white)):
        white[n] += memory * white[n - 1]
    return white


def rounded(values, step):
    return np.rint(values / step) * step if step else values


MOTIONS = [trapezoids, smooth, swing]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize(("step", "memory"), [(0, 0), (1e-6, 0), (0.002, 0), (0.002, 0.9)])
@pytest.mark.parametrize("high", [True, False])
def test_a_range_that_ends_is_told_beside_noise(seed, motion, step, memory, high):
    whole = rounded(motion(20.0) + noise(0.004, memory, seed), step)
    cut = np.minimum(whole, 18.0) if high else np.maximum(whole, motion(20.0).min() + 1.3)
    (end,) = [e for e in ends_of(cut) if e.certain]
    assert (end.largest, end.value) == (high, cut.max() if high else cut.min())
    assert end.count == np.count_nonzero(cut == end.value)
    assert cut[end.first] == end.value


@pytest.mark.parametrize("held", [1, 4])
def test_both_ends_and_a_value_that_is_held(held):
    cut = np.repeat(np.clip(swing(10.5) + noise(0.003, 0, 0), -10, 10), held)
    assert [(e.value, e.certain) for e in ends_of(cut)] == [(10, True), (-10, True)]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("step", [0, 1e-6, 0.002, 0.004, 0.01, 0.02, 0.1, 1.0])
@pytest.mark.parametrize(("rms", "memory"), [(0.0, 0), (0.004, 0), (0.004, 0.9), (0.05, 0)])
def test_a_rest_at_the_end_of_a_stroke_is_none(seed, motion, step, rms, memory):
    values = rounded(motion(20.0) + noise(rms, memory, seed), step)
    assert not [e for e in ends_of(values) if e.certain or e.sharp]


@pytest.mark.parametrize("step", [0.0, 0.01])
def test_a_motion_without_noise_that_stops_as_nowhere_else(step):
    cut = np.minimum(rounded(swing(10.5), step), 10)
    assert [(e.value, e.sharp, e.certain) for e in ends_of(cut)] == [(10, True, False)]


@pytest.mark.parametrize(
    "values",
    [
        [],
        [1.0, 1.0, 1.0, 1.0 + 2e-16] * 9,
        [1.0],
        [1.0] * 5,
        [1.0, 2.0],
        [2.0, 2.0, 2.0, 1.0],
        [1.0, 2.0, 2.0, 2.0, 0.0],
    ],
)
def test_few_readings_tell_nothing(values):
    assert not [e for e in ends_of(np.array(values)) if e.certain or e.sharp]


def test_what_stands_at_one_value_mostly_rests_there():
    values = np.where(TIMES % 6 < 4, 0.0, swing(5.0) + noise(0.3, 0, 0))
    assert not [e for e in ends_of(values) if e.certain or e.sharp]
