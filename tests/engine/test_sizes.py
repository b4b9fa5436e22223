"""Intervals count in tolerances, and in what lies beyond a range."""

import math

import numpy as np
import pytest

import mopro
from helpers.signals import diagnosed, measured, sizes, times
from mopro.engine import Candidate, Parameter
from mopro.engine.candidate import Role

T = times(1000)
SIGMA = 0.2
GAIN = (Parameter("k", "V", 0.0, 10.0, (1.0,)),)
# The model states a mass of 2 that may be off by 10 %, and fits it only if that is called for.
MASS = Candidate("m", (Parameter("m", "kg", 1.0, 3.0, (2.1,), null=2.0, tolerated=(1.8, 2.2)),))


def driven(settings):
    """Only the quotient of gain and mass shows; of a second term the mass shows as well."""
    mass = settings.get("m", {}).get("m", 2.0)
    (line,) = sizes(settings, "line")
    return [settings["base"]["k"] / mass * np.cos(3 * T) + line / mass * np.sin(7 * T)]


def verdict_on(gain, mass, seed=0):
    truth = {"base": {"k": gain}, "m": {"m": mass}}
    (values,) = driven(truth)
    return mopro.reconcile(driven, [MASS], measured(values, SIGMA, seed), base=GAIN)


@pytest.mark.parametrize("mass", [1.84, 1.95, 2.0, 2.1, 2.16])
def test_a_number_that_only_shows_over_a_toleranced_one_is_no_better_known_than_that(mass):
    answer = verdict_on(4.0, mass)
    assert (answer.verdict, answer.calibration) == ("none", ())
    k = answer.base["k"]
    low, high = k.ci95
    assert low < 4.0 < high
    assert low < k.value < high
    # A number that may be anywhere within ± 10 % has a deviation of 10 % / √3.
    by_noise = SIGMA * 2.0 / math.sqrt(np.sum(np.cos(3 * T) ** 2))
    deviation = math.hypot(by_noise, k.value * 0.1 / math.sqrt(3))
    assert high - low == pytest.approx(2 * 1.96 * deviation, rel=0.02)


def test_an_exact_number_leaves_the_interval_to_the_noise():
    truth = {"base": {"k": 4.0}}
    (values,) = driven(truth)
    k = mopro.reconcile(driven, [], measured(values, SIGMA, 1), base=GAIN).base["k"]
    by_noise = SIGMA * 2.0 / math.sqrt(np.sum(np.cos(3 * T) ** 2))
    assert k.ci95[1] - k.ci95[0] == pytest.approx(2 * 1.96 * by_noise, rel=0.02)


def test_intervals_hold_the_truth_wherever_the_mass_is_in_its_tolerance():
    """Twenty masses drawn from the tolerance: 95 % intervals miss no more than three."""
    masses = np.random.default_rng(7).uniform(1.8, 2.2, 20)
    told = [verdict_on(4.0, m, seed).base["k"].ci95 for seed, m in enumerate(masses)]
    assert sum(low <= 4.0 <= high for low, high in told) >= 17


@pytest.mark.parametrize("mass", [1.86, 2.0, 2.14])
def test_a_curved_response_to_a_tolerance_tells_nothing_that_the_free_numbers_make_up_for(mass):
    """Of a decay at k / m a thousand times above the noise, only the quotient shows."""

    def decaying(settings):
        rate = settings["base"]["k"] / settings.get("m", {}).get("m", 2.0)
        return [10.0 * np.exp(-rate * T)]

    (values,) = decaying({"base": {"k": 4.0}, "m": {"m": mass}})
    answer = mopro.reconcile(decaying, [MASS], measured(values, 0.01, 3), base=GAIN)
    assert (answer.verdict, answer.calibration) == ("none", ())
    k = answer.base["k"]
    low, high = k.ci95
    assert low < 4.0 < high
    assert high - low == pytest.approx(2 * 1.96 * k.value * 0.1 / math.sqrt(3), rel=0.02)


def fading(settings):
    """A step that fades within `width`, which may be shorter than is looked for."""
    (values,) = [np.zeros(len(T))]
    if own := settings.get("fade"):
        values = own["a"] * np.exp(-T / own["width"])
    return [values]


@pytest.mark.parametrize(("width", "open_end"), [(0.045, 0), (0.5, None), (5.2, 1)])
def test_a_shape_at_an_end_of_its_range_has_no_end_there(width, open_end):
    fade = Candidate(
        "fade",
        (
            Parameter("a", "V", -100.0, 100.0, (1.0,)),
            Parameter("width", "s", 0.05, 5.0, (0.1, 1.0), Role.SHAPE),
        ),
    )
    truth = {"fade": {"a": 4.0, "width": width}}
    answer = diagnosed(fading, [fade], truth, SIGMA, 3)
    ends = answer.effects[0].parameters["width"].ci95
    assert [math.isinf(end) for end in ends] == [open_end == 0, open_end == 1]
    assert ends[0] <= width <= ends[1]
