"""Readings between the samples of a recording, and on them."""

import numpy as np
import pytest

from mopro.plant.measurement import interpolated

TIME_S = np.arange(400) / 4000.0
VALUES = np.sin(300 * TIME_S)


def test_a_stamp_on_a_sample_reads_it():
    """Also where the quotient of time and interval is rounded to a little beside a whole number."""
    assert (interpolated(TIME_S, VALUES, TIME_S[::2]) == VALUES[::2]).all()


def test_a_stamp_between_samples_is_read_from_a_cubic():
    """Its error is a three-hundredth of that of a straight line, (300 / 4000)² / 8."""
    at_s = TIME_S[5:-5] + 1.25e-4
    error = interpolated(TIME_S, VALUES, at_s) - np.sin(300 * at_s)
    assert np.abs(error).max() < (300 / 4000) ** 2 / 8 / 300


def test_a_stamp_a_little_beside_a_sample_is_read_there():
    """A delay of 50 ns: far more than the rounding of a stamp."""
    at_s = TIME_S[5:-5] + 5e-8
    change = interpolated(TIME_S, VALUES, at_s) - VALUES[5:-5]
    assert change == pytest.approx(5e-8 * 300 * np.cos(300 * TIME_S[5:-5]), rel=0.05, abs=2e-8)
