"""Resonances: the answer of an oscillator in closed form, and drafts of one that is hidden."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mopro
from mopro.engine import Series
from mopro.engine.freeform import measurement_laws
from mopro.engine.swing import swing

TIME_S = np.arange(2000) / 1000.0
# Moments (s) and sizes (m/s²) of the steps of the acceleration of one move.
STEPS = ((0.2005, 4.0), (0.3005, -4.0), (1.0005, -4.0), (1.1005, 4.0))


def after_steps(answer, time_s=TIME_S):
    """The sum of the `answer` to a step of 1 at 0 (a function of the time) over STEPS."""
    since = [(time_s - at, size) for at, size in STEPS]
    return sum(np.where(t > 0, size * answer(np.maximum(t, 0.0)), 0.0) for t, size in since)


def ringing(f_hz, zeta):
    """The answer of an oscillator to a step of 1."""
    w = 2 * np.pi * f_hz
    own = w * np.sqrt(1 - zeta**2)

    def answer(t):
        wave = np.cos(own * t) + zeta * w / own * np.sin(own * t)
        return 1 - np.exp(-zeta * w * t) * wave

    return answer


def test_a_swing_is_the_answer_of_an_oscillator_at_uneven_times():
    rng = np.random.default_rng(1)
    time_s = np.cumsum(rng.uniform(1e-4, 2e-2, 200))
    signal = np.sin(9 * time_s) + 0.3 * rng.standard_normal(200)
    w, zeta = 2 * np.pi * 7.0, 0.08

    def slope(t, y):
        driven = np.interp(t, time_s, signal)
        return [y[1], w * w * (driven - y[0]) - 2 * zeta * w * y[1]]

    found = solve_ivp(
        slope, (time_s[0], time_s[-1]), [signal[0], 0.0], t_eval=time_s, max_step=1e-3, rtol=1e-9
    )
    assert swing(time_s, signal, 7.0, zeta) == pytest.approx(found.y[0], abs=1e-3)


def test_a_swing_rings_after_a_step_as_the_closed_form_does_and_settles_on_the_signal():
    signal = after_steps(np.ones_like)
    expected = after_steps(ringing(23.0, 0.03))
    # A step between two samples is a ramp of one interval there.
    assert swing(TIME_S, signal, 23.0, 0.03) == pytest.approx(expected, abs=0.02)
    assert swing(TIME_S, np.full(2000, 2.5), 23.0, 0.03) == pytest.approx(2.5)


def moved(beside, seed=2, sigma=1e-6):
    """A place that the move of STEPS leads to, measured with `beside` added (m)."""
    place = after_steps(lambda t: t**2 / 2)
    labels = {
        "position": place,
        "velocity": after_steps(lambda t: t),
        "acceleration": after_steps(np.ones_like),
    }
    noise = sigma * np.random.default_rng(seed).standard_normal(len(place))
    series = Series(
        "run", "probe", "m", place + beside + noise, sigma, TIME_S, np.arange(2000) // 500,
        labels=labels, of_place=True,
    )  # fmt: skip
    return series, lambda settings: [place]


def test_what_swings_on_a_spring_is_drafted_with_its_frequency_and_damping():
    series, predict = moved(-5e-6 * after_steps(ringing(23.0, 0.03)))
    (draft,) = mopro.reconcile(predict, [], [series]).drafts
    assert (draft.name, draft.of, draft.held_out) == ("swing of a in probe", "a", True)
    numbers = re.fullmatch(r"(\S+) \* swing\(a, (\S+), (\S+)\)", draft.law).groups()
    size, f_hz, zeta = map(float, numbers)
    assert (size, f_hz, zeta) == pytest.approx((-5e-6, 23.0, 0.03), rel=0.05)


def test_what_follows_the_acceleration_without_a_ring_is_told_by_that_alone():
    series, predict = moved(-5e-6 * after_steps(np.ones_like))
    (draft,) = mopro.reconcile(predict, [], [series]).drafts
    assert draft.name == "a in probe"


def test_nothing_swings_where_no_acceleration_is_told():
    series, _ = moved(0.0)
    bare = Series(
        "run", "probe", "m", series.values, series.sigma, TIME_S, series.folds,
        labels={"position": series.labels["position"]},
    )  # fmt: skip
    names = {law.name for law in measurement_laws([bare])}
    assert "line in time in probe" in names
    assert not any("swing" in name for name in names)
