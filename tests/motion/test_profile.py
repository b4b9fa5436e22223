"""Profiles against the algebra, the source's corrected tables and Hypothesis."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mopro.motion import Shape, plan_profile
from mopro.testing import check_profile, profiles


@given(profiles(), st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_every_profile_keeps_its_invariants(profile, fractions):
    check_profile(profile, fractions)


@given(profiles(), st.floats(0.001, 0.999))
def test_velocity_and_acceleration_are_derivatives(profile, fraction):
    """Central differences of a cubic are exact but for j h²/6 and rounding."""
    t = fraction * profile.duration_s
    h = profile.duration_s * 1e-4
    corners = [profile.ramp_s, profile.ramp_s + profile.cruise_s]
    assume(h < t < profile.duration_s - h and all(abs(t - c) > h for c in corners))
    before, here, after = (profile.state(t + d) for d in (-h, 0.0, h))
    slope = (after.position - before.position) / (2 * h)
    curve = (after.velocity - before.velocity) / (2 * h)
    cubic = abs(profile.jerk) * h * h / 6
    rounding = 4e-16 * profile.distance / h
    assert slope == pytest.approx(
        here.velocity, rel=1e-9, abs=1.01 * cubic + rounding + 1e-9 * profile.peak_velocity
    )
    rounding = 4e-16 * profile.peak_velocity / h
    assert curve == pytest.approx(
        here.acceleration, rel=1e-9, abs=rounding + 1e-9 * profile.acceleration
    )


@given(st.floats(1e-2, 1e4), st.floats(1e-2, 1e4), st.floats(1e-2, 1e4), st.booleans(),
       st.floats(1e-3, 1e3), st.floats(0, 1))  # fmt: skip
def test_a_change_of_units_scales_lengths_and_leaves_times(s, v, a, parabolic, factor, fraction):
    one = plan_profile(s, v, a, parabolic)
    other = plan_profile(s * factor, v * factor, a * factor, parabolic)
    assert other.duration_s == pytest.approx(one.duration_s, rel=1e-7)
    t = fraction * one.duration_s
    scaled = one.state(t).position * factor
    assert other.state(t).position == pytest.approx(scaled, rel=1e-6, abs=1e-6 * s * factor)


@given(profiles(), st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6), st.floats(0, 1))
def test_a_minor_axis_is_the_majors_scaled_copy(profile, start, stroke, fraction):
    assume(profile.distance > 0)
    t = fraction * profile.duration_s
    minors = profile.segments(0.0, float(start), float(stroke))
    for minor, major in zip(minors, profile.segments(), strict=True):
        if major.start_s <= t <= major.end_s:
            ratio = stroke / profile.distance
            expected = start + major.state(t).position * ratio
            scale = max(abs(start), abs(stroke), 1.0)
            assert minor.state(t).position == pytest.approx(expected, abs=1e-9 * scale)
            assert minor.state(t).velocity == pytest.approx(
                major.state(t).velocity * ratio, abs=1e-9 * profile.peak_velocity * abs(ratio)
            )
    assert minors[-1].state(minors[-1].end_s).position == start + stroke


# Table 4.5: s (in), V (in/s), a (in/s²), PARA, profile.
EXPERIMENTS = [
    (8, 15, 50, False, "trapezoid"),
    (8, 15, 10, False, "triangle"),
    (8, 15, 50, True, "parabola"),
    (8, 15, 10, True, "parabola"),
    (8, 15, 200, True, "smooth"),
    (15, 40, 250, False, "trapezoid"),
    (15, 40, 100, False, "triangle"),
    (15, 40, 100, True, "parabola"),
    (15, 40, 250, True, "parabola"),
    (15, 40, 600, True, "smooth"),
]


@pytest.mark.parametrize(("s", "v", "a", "parabolic", "shape"), EXPERIMENTS)
def test_shapes_of_table_4_5(s, v, a, parabolic, shape):
    assert plan_profile(s, v, a, parabolic).shape == shape


@pytest.mark.parametrize(
    ("shape", "profile", "duration_s", "peak"),
    [
        ("trapezoid", plan_profile(15, 40, 250), 15 / 40 + 40 / 250, 40),
        ("triangle", plan_profile(15, 40, 100), 2 * math.sqrt(15 / 100), math.sqrt(15 * 100)),
        ("smooth", plan_profile(15, 40, 600, True), 15 / 40 + 4 * 40 / 600 - 8 * 40 / 1800, 40),
        ("parabola", plan_profile(15, 40, 250, True), math.sqrt(90 / 250), math.sqrt(22500) / 4),
    ],
)
def test_durations_and_peaks_in_closed_form(shape, profile, duration_s, peak):
    assert profile.shape == shape
    assert profile.duration_s == pytest.approx(duration_s, rel=1e-14)
    assert profile.peak_velocity == pytest.approx(peak, rel=1e-14)


class TestErrata:
    """The printed formulas and the right ones, told apart at numbers of the experiments."""

    def test_1_trapezoid_third_phase(self):
        s, v, a = 15.0, 40.0, 250.0
        profile = plan_profile(s, v, a)
        t = profile.duration_s - 0.04
        common = -v * v / (2 * a) + v * t + a * s * t / v - a * t * t / 2
        assert profile.state(t).position == pytest.approx(common - a * s * s / (2 * v * v))
        assert abs(profile.state(t).position - (common + a * s * s / (2 * v * v))) > 1

    def test_2_triangle_second_half(self):
        s, a = 15.0, 100.0
        profile = plan_profile(s, 40.0, a)
        t = profile.duration_s - 0.1
        right = -s + 2 * math.sqrt(s * a) * t - a * t * t / 2
        assert profile.state(t).position == pytest.approx(right)
        peak = math.sqrt(s * a)
        printed = s - math.sqrt(s / a) * peak + peak * t + a * math.sqrt(s / a) * t - a * t * t / 2
        assert abs(profile.state(t).position - printed) == pytest.approx(s)

    def test_3_smooth_cruise_and_brake(self):
        s, v, a = 15.0, 40.0, 600.0
        profile = plan_profile(s, v, a, True)
        t = profile.ramp_s + profile.cruise_s / 2
        assert profile.state(t).position == pytest.approx(v * t - 2 * v * v / (3 * a))
        assert abs(profile.state(t).position - (v * t + 2 * v * v / (3 * a))) > 1
        t = profile.duration_s - 0.05
        tau = t - profile.cruise_s
        ramp = -(a * a) / (12 * v) * tau**3 + a / 2 * tau**2
        assert profile.state(t).position == pytest.approx(ramp + v * profile.cruise_s)

    @pytest.mark.parametrize("factor", [8 / 3 * 1.0001, 4.0, 16 / 3])
    def test_4_smooth_from_eight_thirds_on(self, factor):
        v, a = 40.0, 600.0
        at = plan_profile(factor * v * v / a, v, a, True)
        assert at.shape == Shape.SMOOTH
        assert at.duration_s == pytest.approx(at.distance / v + 4 * v / (3 * a))
        below = plan_profile(8 / 3 * 0.9999 * v * v / a, v, a, True)
        assert below.shape == Shape.PARABOLA

    def test_4_no_cruise_exactly_at_eight_thirds(self):
        v, a = 40.0, 600.0
        profile = plan_profile(8 * v * v / (3 * a), v, a, True)
        assert profile.cruise_s == pytest.approx(0, abs=1e-15)
        assert profile.duration_s == pytest.approx(4 * v / a)

    def test_5_parabola(self):
        s, a = 15.0, 250.0
        profile = plan_profile(s, 40.0, a, True)
        t = 0.11
        curve = math.sqrt(6) * a**1.5 / math.sqrt(s)
        assert profile.state(t).velocity == pytest.approx(a * t - curve / 6 * t * t)
        assert profile.state(t).position == pytest.approx(a * t * t / 2 - curve / 18 * t**3)
        assert abs(profile.state(t).velocity - (a * t + curve / 6 * t * t)) > 1
        assert profile.duration_s == pytest.approx(math.sqrt(6 * s / a))


@pytest.mark.parametrize(("s", "v", "a"), [(-1, 1, 1), (1, 0, 1), (1, 1, 0), (1, -2, 1)])
def test_impossible_profiles_are_refused(s, v, a):
    with pytest.raises(ValueError, match="needs distance"):
        plan_profile(s, v, a)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_at_equal_set_acceleration_a_constant_one_is_never_slower(s, v, a):
    """The gain of parabolic profiles is only that the motor can start them harder."""
    constant, parabolic = plan_profile(s, v, a), plan_profile(s, v, a, True)
    assert constant.duration_s <= parabolic.duration_s * (1 + 1e-12)
