"""Noise with a memory, prices of parameters, and assumed constants, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import fft, signal, special

import mopro
from helpers.signals import candidates, diagnosed, measured, names, sizes, times
from mopro.engine import Candidate, Parameter, Role, Series
from mopro.engine.fits import Evidence, least_squares_fit
from mopro.engine.residuals import Residuals
from mopro.engine.residuals.noise_model import Noise, effective_samples


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


def flat(samples, seed=0, size=1.0):
    """A residual with the same power at each frequency of its cosine transform."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], samples)
    return fft.idct(size * signs, norm="ortho")


def test_the_bands_are_half_an_octave_wide_and_cover_all_frequencies():
    ((_, first, width, _, _),) = noise_of(1.0, samples=2000).like(flat(2000)).bands
    assert first[0] == 0
    assert list(first + width) == [*first[1:], 2000]
    assert width[:-1].min() >= 3
    wide = first[:-1] >= 10
    assert first[1:][wide] / first[:-1][wide] == pytest.approx(math.sqrt(2), rel=0.06)


@pytest.mark.parametrize("stated", [1.0, None])
def test_the_deviance_of_more_power_everywhere_is_that_of_its_estimated_variance(stated):
    """n ln(variance), as for white noise of unknown size; less power is no better."""
    remainder = flat(2000, size=3.0)
    noise = noise_of(stated, samples=2000).like(remainder)
    assert noise.deviance(2.0 * remainder) == pytest.approx(2000 * math.log(4.0))
    assert noise.deviance(remainder) == pytest.approx(0.0, abs=1e-9)
    assert noise.deviance(0.5 * remainder) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("cycles", "band"), [(2.0, 3), (400.0, None)])
def test_a_line_counts_by_the_power_of_the_noise_in_its_band(cycles, band):
    """m ln(1 + A² / (m S)): what it would be known to by m frequencies of noise of power S."""
    power, height, samples = 4.0, 20.0, 2000
    remainder = flat(samples, size=math.sqrt(power))
    noise = noise_of(1.0, samples=samples).like(remainder)
    ((_, first, width, _, _),) = noise.bands
    own = int(np.searchsorted(first, 2 * cycles, side="right")) - 1
    m = float(width[own])
    assert m == band or band is None
    # In quadrature to what is there at its frequency: that is taken out first.
    at_line = fft.dct(remainder, norm="ortho")
    at_line[int(2 * cycles)] = math.hypot(at_line[int(2 * cycles)], height)
    deviance = noise.deviance(fft.idct(at_line, norm="ortho"))
    assert deviance == pytest.approx(m * math.log1p(height**2 / (m * power)))
    if m > 100:
        assert deviance == pytest.approx(height**2 / power, rel=0.25)


def test_a_slow_change_counts_little_against_noise_that_wanders():
    """A slow and a quick change of equal chi-squared, against a wander and white noise."""
    rng = np.random.default_rng(2)
    wander = signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal(5000))
    remainder = wander + 1.2 * rng.standard_normal(5000)
    noise = noise_of(1.0, samples=5000).like(remainder)
    counts = [noise.deviance(remainder + 20 * line(cycles, 5000)) for cycles in (10, 2000)]
    assert counts[0] < 40 < 150 < counts[1]


def test_the_power_of_the_noise_in_each_band_is_that_of_theory():
    white = np.random.default_rng(2).standard_normal(20_000)
    noise = noise_of(None, samples=20_000).like(signal.lfilter([1.0], [1.0, -0.9], white))
    ((_, first, width, _, density),) = noise.bands
    middle = np.pi * (first + width / 2) / 20_000
    theory = 1 / np.abs(1 - 0.9 * np.exp(-1j * middle)) ** 2
    wide = width > 300
    assert wide.sum() >= 6
    assert density[wide] == pytest.approx(theory[wide], rel=0.2)


def test_the_spectrum_is_never_below_stated_noise():
    """Unstated noise has no such floor."""
    quiet = flat(2000, size=0.1)
    ((*_, stated),) = noise_of(1.0, samples=2000).like(quiet).bands
    assert (stated == 1.0).all()
    ((*_, unstated),) = noise_of(None, samples=2000).like(quiet).bands
    assert unstated == pytest.approx(0.01)


def test_each_series_has_a_spectrum_of_its_own():
    noise = noise_of(1.0, 1.0, samples=1000).like(np.concatenate([flat(1000), 5 * flat(1000)]))
    (one, _, _, _, first), (other, _, _, _, second) = noise.bands
    assert (one, other) == (slice(0, 1000), slice(1000, 2000))
    assert first == pytest.approx(1.0)
    assert second == pytest.approx(25.0)


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


@pytest.mark.parametrize(
    ("low", "high", "plausible"), [(10.0, 30.0, None), (0.0, 90.0, (10.0, 30.0))]
)
def test_a_constant_costs_what_the_data_tell_about_it(low, high, plausible):
    """2 ln of the ratio of the standard deviations before and after (Laplace)."""
    series = Series("run", "probe", "V", 1.0 * SPEED, 0.3, nuisances=np.zeros((len(T), 0)))

    def simulate(settings):
        return [settings["line"]["c"] / 20.0 * SPEED]

    residuals = Residuals(simulate, [series])
    known = Parameter("c", "1", low, high, (20.0,), Role.CONSTANT, plausible=plausible)
    constant = Candidate("line", (known,))
    fit = least_squares_fit(residuals, [constant], [{"line": {"c": 20.0}}])
    evidence = Evidence(Noise.as_stated(residuals), [constant.key])
    before = 20.0 / math.sqrt(12)
    after = 0.3 * 20.0 / math.sqrt(float(SPEED @ SPEED))
    assert evidence.ebic(fit) == pytest.approx(2 * math.log(before / after), abs=0.01)


def test_a_constant_beside_what_cannot_be_identified_costs_nothing():
    series = Series("run", "probe", "V", 1.0 * SPEED, 0.3, nuisances=np.zeros((len(T), 0)))
    other = Parameter("c", "V", -10.0, 10.0, (1.0,))

    def simulate(settings):
        return [(settings["line"]["b"] + settings["line"]["c"]) * SPEED]

    residuals = Residuals(simulate, [series])

    def ebic(*parameters):
        candidate = Candidate("line", parameters)
        start = {p.name: p.starts[0] for p in parameters}
        fit = least_squares_fit(residuals, [candidate], [{"line": start}])
        evidence = Evidence(Noise.as_stated(residuals), [candidate.key])
        # What is assumed stays known as well as it was before.
        known = [math.inf, math.inf, 20.0 / math.sqrt(12)]
        assert evidence.deviations(fit).tolist() == pytest.approx(known[: len(parameters)])
        return evidence.ebic(fit)

    assert ebic(B, other, ASSUMED) == pytest.approx(ebic(B, other), abs=0.01)


@pytest.mark.parametrize("sigma", [0.3, None], ids=["stated", "unknown"])
def test_numbers_of_which_the_data_tell_only_the_product_leave_the_others_known(sigma):
    """A spring k m beside a line with much in common with it, as the product p beside that line."""
    shapes = np.column_stack([np.sin(3 * T), np.sin(3 * T) + 0.5 * np.cos(7 * T)])
    values = shapes @ [6.0, 1.5] + 0.3 * np.random.default_rng(2).standard_normal(len(T))
    series = Series("run", "probe", "V", values, sigma, nuisances=np.zeros((len(T), 0)))
    k, m, p, size = (Parameter(name, "V", 0.0, 90.0, (2.0,)) for name in ("k", "m", "p", "size"))

    def simulate(settings):
        own = {"p": 1.0, "k": 1.0, "m": 1.0, **settings.get("both", {"size": 0.0})}
        return [shapes @ [own["p"] * own["k"] * own["m"], own["size"]]]

    def covariance(*parameters):
        residuals = Residuals(simulate, [series])
        both = Candidate("both", parameters)
        start = {"both": {each.name: each.starts[0] for each in parameters}}
        fit = least_squares_fit(residuals, [both], [start])
        return Evidence(Noise.as_stated(residuals), [both.key]).covariance(fit)

    of_factors, of_product = covariance(k, m, size), covariance(p, size)
    assert np.isinf(of_factors[:2]).all()
    assert np.isinf(of_factors[:, :2]).all()
    assert of_factors[2, 2] == pytest.approx(of_product[1, 1], rel=0.01)


def test_an_effect_counts_in_full_where_the_noise_is_quieter_than_stated():
    """In white noise of 0.8 of the stated size, as far as its wide bands go: A² / 1."""
    quiet = 0.8 * np.random.default_rng(3).standard_normal(4000)
    noise = noise_of(1.0, samples=4000).like(quiet)
    t = np.arange(4000)
    shape = np.cos(np.pi * (t + 0.5) * 3000 / 4000)
    shape *= 14 / np.linalg.norm(shape)
    shape -= quiet * (shape @ quiet) / (quiet @ quiet)
    assert noise.deviance(quiet + shape) == pytest.approx(14**2, rel=0.1)
    assert noise.deviance(quiet) == 0.0


def test_a_period_as_long_as_the_data_can_tell_is_a_bend():
    """A parabola is no ripple, however much of it the longest ripple takes away."""
    t = times(500)

    def simulate(settings):
        own = {"size": 0.0, "period": 1.0, "turn": 0.0, **settings.get("ripple", {})}
        return [own["size"] * np.sin(2 * np.pi * t / own["period"] + own["turn"])]

    ripple = Candidate(
        "ripple",
        (
            Parameter("size", "V", 0.0, 100.0, (1.0,)),
            Parameter("period", "s", 0.1, 6.0, (1.0, 5.0), Role.SHAPE, inverse=True),
            Parameter("turn", "rad", -math.pi, math.pi, (0.0,), Role.PHASE),
        ),
        flexible=True,
    )
    data = [replace(s, sigma=None) for s in measured((t - 2.5) ** 2, 0.5, 1)]
    verdict = mopro.reconcile(simulate, [ripple], data)
    assert names(verdict) == set()


@pytest.mark.parametrize("other", ["turn", "idle"])
def test_an_interval_ends_where_the_range_of_its_parameter_does(other):
    """The interval of a size stops at its range, which the fit cannot leave either.

    That of an angle does not, and that of a number on which nothing depends is infinite.
    """
    t = times(200)

    def simulate(settings):
        own = {"size": 0.0, "turn": 0.0, **settings.get("both", {})}
        return [own["size"] * np.sin(7 * t + own["turn"])]

    others = {
        "turn": Parameter("turn", "rad", -math.pi, math.pi, (0.0,), Role.PHASE),
        "idle": Parameter("idle", "V", 0.0, 2.0, (1.0,)),
    }
    both = Candidate("both", (Parameter("size", "V", 0.0, 10.0, (1.0,)), others[other]))
    residuals = Residuals(simulate, measured(0.1 * np.sin(7 * t), 1.0, 1))
    start = {"both": {"size": 0.1, other: others[other].starts[0]}}
    fit = least_squares_fit(residuals, [both], [start])
    evidence = Evidence(Noise.as_stated(residuals), [both.key])
    ends = {p.name: own for (_, p), own in zip(fit.order, evidence.intervals(fit), strict=True)}
    if other == "idle":
        assert ends["idle"] == (-math.inf, math.inf)
        half = special.ndtri(0.975) / math.sqrt(float(np.sum(np.sin(7 * t) ** 2)))
        assert ends["size"][1] - fit.settings["both"]["size"] == pytest.approx(half, rel=0.01)
    else:
        assert ends["size"][0] == 0.0 < fit.settings["both"]["size"] < ends["size"][1] < 1.0
        assert ends["turn"][1] - fit.settings["both"]["turn"] > 1.0


def test_another_effect_out_of_a_small_catalogue_earns_nothing():
    for listed in range(1, 8):
        evidence = Evidence(noise_of(1.0, samples=100), [(f"e{i}", "") for i in range(listed)])
        choices = [evidence.of_choice(chosen) for chosen in range(10)]
        assert choices == sorted(choices)
        assert choices[1] == pytest.approx(2 * math.log(listed))
