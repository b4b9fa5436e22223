"""Noise with a memory, prices of parameters, and assumed constants, against closed forms."""

import math

import numpy as np
import pytest
from scipy import signal, stats

from helpers.signals import candidates, diagnosed, names, sizes, times
from mopro.diagnosis import Candidate, Parameter, Role, Series
from mopro.diagnosis.evidence import Evidence
from mopro.diagnosis.fit import least_squares_fit
from mopro.diagnosis.noise import Noise, effective_samples
from mopro.diagnosis.residual import Residuals


def noise_of(*sigmas, samples):
    series = [
        Series(f"run {i}", "probe", "V", np.zeros(samples), sigma) for i, sigma in enumerate(sigmas)
    ]
    return Noise.as_stated(Residuals(lambda _: [s.values for s in series], series))


def line(cycles, samples):
    """A line of the discrete cosine transform, of norm 1."""
    angle = 2 * np.pi * cycles * (np.arange(samples) + 0.5) / samples
    return math.sqrt(2 / samples) * np.cos(angle)


def test_white_noise_is_worth_its_samples_and_a_line_three():
    worth = [
        effective_samples(np.random.default_rng(seed).standard_normal(2000)) for seed in range(10)
    ]
    assert np.mean(worth) == pytest.approx(2000, rel=0.05)
    assert effective_samples(line(20, 2000)) == pytest.approx(3.0)
    assert effective_samples(np.ones(1)) == 1.0


def test_noise_with_a_memory_is_worth_fewer_samples():
    """First order, 0.9 of the last one: 1 / (1 - a)² as strong at its slowest as white noise."""
    white = np.random.default_rng(1).standard_normal(20_000)
    slow = signal.lfilter([1.0], [1.0, -0.9], white)
    # n (∫S)² / ∫S² of the spectrum S = 1 / |1 - a e^{-iω}|²: (1 - a²) / (1 + a²).
    assert effective_samples(slow) == pytest.approx(20_000 * 0.19 / 1.81, rel=0.15)


@pytest.mark.parametrize("freedom", [3.0, 20.0, 1e6])
@pytest.mark.parametrize("size", [0.5, 3.0, 30.0])
def test_the_deviance_of_an_excess_is_that_of_students_t(size, freedom):
    density = 2.5
    t = stats.t(freedom)
    expected = -2 * (t.logpdf(size) - t.logpdf(0.0))
    assert Noise.of_excess(size**2 * density, density, freedom) == pytest.approx(expected)


def test_an_excess_below_the_remainder_has_no_deviance():
    assert Noise.of_excess(-5.0, 1.0, 10.0) == 0.0


def test_the_density_where_a_change_has_its_power_is_that_of_the_noise():
    white = np.random.default_rng(2).standard_normal(20_000)
    slow = noise_of(1.0, samples=20_000).like(signal.lfilter([1.0], [1.0, -0.9], white))
    for cycles in (400, 2000):
        omega = 2 * np.pi * cycles / 20_000
        theory = 1 / abs(1 - 0.9 * np.exp(-1j * omega)) ** 2
        density, freedom = slow.in_spectrum(7 * line(cycles, 20_000))
        assert density == pytest.approx(max(theory, 1.0), rel=0.15)
        # A quarter of the index to either side; a line of k cycles has the index 2 k.
        assert freedom == pytest.approx(cycles, rel=0.01)


def test_the_spectrum_is_never_below_stated_noise():
    """Unstated noise has no such floor."""
    quiet = 0.1 * np.random.default_rng(3).standard_normal(2000)
    ((_, stated, _),) = noise_of(1.0, samples=2000).like(quiet).spectra
    assert (stated == 1.0).all()
    ((_, unstated, _),) = noise_of(None, samples=2000).like(quiet).spectra
    assert np.median(unstated) == pytest.approx(0.01, rel=0.1)


def test_each_series_has_a_spectrum_of_its_own():
    rng = np.random.default_rng(4)
    remainder = np.concatenate([rng.standard_normal(1000), 5 * rng.standard_normal(1000)])
    noise = noise_of(1.0, 1.0, samples=1000).like(remainder)
    silent = np.zeros(1000)
    first, _ = noise.in_spectrum(np.concatenate([line(200, 1000), silent]))
    second, _ = noise.in_spectrum(np.concatenate([silent, line(200, 1000)]))
    assert first == pytest.approx(1.0, rel=0.2)
    assert second == pytest.approx(25.0, rel=0.2)


# -- assumed constants -------------------------------------------------------------------

T = times()
SPEED, WARMTH_K = np.cos(7 * T), 10 * np.sin(3 * T)


def warm(settings):
    """A drag in proportion to the temperature above one that is assumed to be 20 °C."""
    own = settings.get("warm", {"b": 0.0})
    above_K = WARMTH_K + 20.0 - own.get("T0", 20.0)
    (plain,) = sizes(settings, "plain")
    return [own["b"] * above_K / 10 * SPEED + plain * SPEED]


B = Parameter("b", "V", -10.0, 10.0, (1.0,))
ASSUMED = Parameter("T0", "C", 10.0, 30.0, (20.0,), Role.CONSTANT)


@pytest.mark.parametrize(
    ("parameters", "expected"), [((B,), {"warm", "plain"}), ((B, ASSUMED), {"warm"})]
)
@pytest.mark.parametrize("seed", range(3))
def test_a_constant_that_is_wrong_by_a_plausible_amount_makes_no_false_pair(
    parameters, expected, seed
):
    """The temperature is 23 °C: taken for 20 °C for granted, a drag that is not there mends it."""
    effects = [Candidate("warm", parameters), *candidates("plain")]
    truth = {"warm": {"b": 1.0, "T0": 23.0}}
    verdict = diagnosed(warm, effects, truth, 0.3, seed)
    assert names(verdict) == expected
    if ASSUMED in parameters:
        (effect,) = verdict.effects
        low, high = effect.parameters["T0"].ci95
        assert low - 1 < 23.0 < high + 1
        assert high - low < 2.0


def test_a_constant_that_the_data_do_not_tell_costs_nothing():
    def simulate(settings):
        return [settings.get("line", {"b": 0.0})["b"] * SPEED]

    def evidence(*parameters):
        truth = {"line": {"b": 0.2}}
        (effect,) = diagnosed(simulate, [Candidate("line", parameters)], truth, 0.5, 1).effects
        return effect.log10_bayes_factor, effect.parameters

    plain, _ = evidence(B)
    free, _ = evidence(B, Parameter("n", "1", 10.0, 30.0, (20.0,), Role.SHAPE))
    assumed, estimates = evidence(B, ASSUMED)
    assert assumed == pytest.approx(plain, abs=0.01)
    assert free < plain - 1.0
    low, high = estimates["T0"].ci95
    assert low < 12.0
    assert high > 28.0


def test_a_constant_costs_what_the_data_tell_about_it():
    """2 ln of the ratio of the standard deviations before and after (Laplace)."""
    series = Series("run", "probe", "V", 1.0 * SPEED, 0.3, nuisances=np.zeros((len(T), 0)))

    def simulate(settings):
        return [settings["line"]["c"] / 20.0 * SPEED]

    residuals = Residuals(simulate, [series])
    constant = Candidate("line", (Parameter("c", "1", 10.0, 30.0, (20.0,), Role.CONSTANT),))
    fit = least_squares_fit(residuals, [constant], [{"line": {"c": 20.0}}])
    evidence = Evidence(Noise.as_stated(residuals), [constant.key])
    before = 20.0 / math.sqrt(12)
    after = 0.3 * 20.0 / math.sqrt(float(SPEED @ SPEED))
    assert evidence.ebic(fit) == pytest.approx(2 * math.log(before / after), abs=0.01)
