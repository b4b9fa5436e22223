"""The invariants of profiles are those that a damaged profile breaks."""

from dataclasses import replace

import pytest

from mopro.motion import plan_profile
from mopro.testing import check_profile

TRAPEZOID = plan_profile(10.0, 4.0, 8.0)
TRIANGLE = plan_profile(1.0, 4.0, 8.0)


@pytest.mark.parametrize(
    ("damaged", "broken"),
    [
        (replace(TRAPEZOID, peak_velocity=3.0), "jumps in position"),
        (replace(TRAPEZOID, cruise_s=TRAPEZOID.cruise_s / 2), "jumps in position"),
        (replace(TRIANGLE, velocity=2.0), "exceeds its velocity"),
        (replace(TRIANGLE, ramp_s=TRIANGLE.ramp_s / 2), "jumps in"),
    ],
)
def test_a_damaged_profile_is_told_which_invariant_it_breaks(damaged, broken):
    check_profile(TRAPEZOID)
    check_profile(TRIANGLE)
    with pytest.raises(AssertionError, match=broken):
        check_profile(damaged)
