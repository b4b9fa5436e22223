"""Effects that resemble what is missing: their size differs from part to part."""

from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.signals import candidates, diagnosed, measured, names, of_size, sizes, times
from mopro.engine import Parameter
from mopro.engine.fits import parts_of, spread
from mopro.engine.residuals import Residuals
from mopro.engine.search.hypotheses import Hypotheses

T = times(1000)
MOVE = (T / T[-1] * 4.999).astype(int)
# Height of an unlisted wave in each of the five moves.
HEIGHTS = np.array([0.4, 1.5, 0.7, 1.9, 0.9])


def model(settings):
    """`wave` is the same in all moves; `varying`, which is in no catalogue, is not."""
    wave, varying = sizes(settings, "wave", "varying")
    return [(wave + varying * HEIGHTS[MOVE]) * np.sin(9 * T)]


def slope(settings):
    (size,) = sizes(settings, "slope")
    return [size * T]


def spread_of(truth, seed=0, sigma=0.05, beside=0.0):
    (values,) = model(truth)
    residuals = Residuals(model, measured(values + beside, sigma, seed))
    (wave,) = candidates("wave")
    hypotheses = Hypotheses(residuals, [wave])
    fit = hypotheses.fitted([wave], of_size(wave=1.0))
    return spread(
        residuals, hypotheses.evidence.noise, parts_of(residuals), fit, "wave", fit.rss - fit.count
    )


def test_a_true_effect_has_one_size():
    shares = [spread_of(of_size(wave=1.0), seed) for seed in range(40)]
    assert not any(s.significant for s in shares)
    assert max(s.share for s in shares) < 0.03


def test_the_spread_is_that_of_the_sizes():
    """Standard deviation of the five heights over their mean, which is the fitted size."""
    found = spread_of(of_size(varying=1.0))
    assert found.significant
    assert found.of_a_stand_in
    assert found.share == pytest.approx(HEIGHTS.std(ddof=1) / HEIGHTS.mean(), rel=0.1)


@pytest.mark.parametrize("sigma", [0.05, 0.005])
def test_a_small_spread_that_is_most_of_what_remains_is_a_stand_ins(sigma):
    """Whatever the noise: what remains is the same."""
    found = spread_of(of_size(wave=1.0, varying=0.1), sigma=sigma)
    assert found.significant
    assert found.share == pytest.approx(
        0.1 * HEIGHTS.std(ddof=1) / (1 + 0.1 * HEIGHTS.mean()), rel=0.1
    )
    assert found.of_a_stand_in


def test_sizes_that_differ_by_less_than_a_linear_approximation_errs_are_one_size():
    found = spread_of(of_size(wave=1.0, varying=0.02), sigma=1e-3)
    assert found.significant
    assert (found.share < 0.02, found.of_remainder > 0.9) == (True, True)
    assert not found.of_a_stand_in


def test_the_spread_is_the_same_without_nuisances():
    """The offsets of the parts take what nuisances would."""
    (values,) = model(of_size(varying=1.0))
    data = [replace(s, nuisances=np.zeros((len(s), 0))) for s in measured(values, 0.05, 0)]
    residuals = Residuals(model, data)
    (wave,) = candidates("wave")
    hypotheses = Hypotheses(residuals, [wave])
    fit = hypotheses.fitted([wave], of_size(wave=1.0))
    found = spread(residuals, hypotheses.evidence.noise, parts_of(residuals), fit, "wave", 1.0)
    assert found.share == pytest.approx(spread_of(of_size(varying=1.0)).share, rel=0.01)


def test_a_small_spread_beside_something_larger_is_no_stand_ins():
    found = spread_of(of_size(wave=1.0, varying=0.1), beside=0.5 * np.cos(31 * T))
    assert found.significant
    assert not found.of_a_stand_in


def test_what_is_slow_is_taken_for_an_offset_and_not_for_another_size():
    """A size for each part fits anything slow beside an effect that is slow itself."""
    values = T + 0.5 * (1 - np.exp(-T / 1.5))
    residuals = Residuals(slope, measured(values, 0.05, 0))
    (candidate,) = candidates("slope")
    hypotheses = Hypotheses(residuals, [candidate])
    fit = hypotheses.fitted([candidate], of_size(slope=1.0))
    found = spread(
        residuals, hypotheses.evidence.noise, parts_of(residuals), fit, "slope", fit.rss - fit.count
    )
    assert found.of_remainder < 0.3
    assert not found.of_a_stand_in


def test_two_parts_do_not_tell():
    (values,) = model(of_size(wave=1.0))
    residuals = Residuals(model, measured(values, 0.05, 0))
    (wave,) = candidates("wave")
    hypotheses = Hypotheses(residuals, [wave])
    fit = hypotheses.fitted([wave], of_size(wave=1.0))
    noise = hypotheses.evidence.noise
    assert spread(residuals, noise, [MOVE < 2, MOVE >= 2], fit, "wave", fit.rss) is None


def test_what_stands_in_is_not_named_and_the_reason_is_given():
    verdict = diagnosed(model, candidates("wave"), of_size(varying=1.0), 0.05, seed=1)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    reasons = [r.reason for r in verdict.rejected if r.name == "wave"]
    assert any("it stands in for something else" in reason for reason in reasons)


def test_a_true_effect_is_named_beside_what_nobody_listed():
    def both(settings):
        (wave,) = model(settings)
        (steady,) = sizes(settings, "steady")
        return [wave + steady * np.cos(31 * T)]

    truth = of_size(steady=2.0, varying=1.0)
    verdict = diagnosed(both, candidates("wave", "steady"), truth, 0.05, seed=1)
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"steady"})


@pytest.mark.parametrize(("most", "expected"), [(2.0, {"wave"}), (0.9, set())])
def test_an_effect_whose_size_would_be_beyond_its_range_stands_in(most, expected):
    """The data have 1 V of the wave, of which the range allows `most`, and an unlisted drift."""

    def simulate(settings):
        (wave,) = sizes(settings, "wave")
        return [wave * np.sign(np.sin(9 * T))]

    size = Parameter("size", "V", 0.0, most, (0.5,), plausible=(0.0, most / 1.5))
    (values,) = simulate(of_size(wave=1.0))
    data = measured(values + 0.05 * np.sin(0.5 * T) ** 2, 0.05, 0)
    verdict = mopro.reconcile(simulate, candidates("wave", size=size), data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", expected)
    reasons = [r.reason for r in verdict.rejected if r.name == "wave"]
    assert ["end of its range" in reason for reason in reasons] == [True] * (not expected)
