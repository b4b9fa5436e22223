"""Noise: white, with memory, unknown, at rest; and the tests that tell it from a residual."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal, stats

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import family, names
from mopro.engine import Series
from mopro.engine.residuals import Residuals, difference_variance
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.residuals.noise_tests import (
    bartlett_log_p,
    cumulative_periodogram,
    cusum_step,
    whiteness_p,
)
from mopro.engine.search.hypotheses import Hypotheses

SIGMA = 0.1


def autoregressive(memory, samples, rng):
    """Noise of first order: each sample is `memory` times the last one plus white noise."""
    return signal.lfilter([1.0], [1.0, -memory], rng.standard_normal(samples))


def test_the_difference_variance_is_that_of_the_white_noise_alone():
    rng = np.random.default_rng(2)
    slow = 20 * np.sin(np.linspace(0.0, 6.0, 20_000))
    assert difference_variance(slow + rng.standard_normal(20_000)) == pytest.approx(1.0, rel=0.03)
    assert difference_variance(np.ones(1)) == 0.0


@pytest.mark.parametrize("memory", [0.6, 0.9])
def test_the_power_of_means_is_that_with_which_they_scatter(memory):
    """That of noise of first order is (1 + memory) / (1 - memory) times that of white noise."""
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(300):
        noise = math.sqrt(1 - memory**2) * autoregressive(memory, 4000, rng)
        left = noise - noise.mean()
        power = Noise((3999,), (0,), (True,), left).power_of_means(left)[0]
        ratios.append(noise.mean() * math.sqrt(4000 / power))
    assert np.std(ratios) == pytest.approx(1.0, abs=0.12)


def test_whiteness_is_rejected_as_often_as_its_p_value_says():
    rng = np.random.default_rng(6)
    p = [whiteness_p(rng.standard_normal(500)) for _ in range(400)]
    assert stats.kstest(p, "uniform").pvalue > 0.01
    assert whiteness_p(autoregressive(0.5, 500, rng)) < 1e-6


def test_whiteness_of_a_short_series_or_of_a_constant_is_not_rejected():
    assert whiteness_p(np.arange(59.0)) == 1.0
    assert whiteness_p(np.ones(500)) == 1.0


def test_the_p_value_of_whiteness_has_no_jump_where_its_first_term_takes_over():
    """At Kolmogorov distances of 3, to either side of it."""

    def log_p(distance, n=400):
        # Half of the shares moved up by d have their largest distance, d, in the middle.
        even = (np.arange(n) + 0.5) / n
        return bartlett_log_p(np.clip(even + distance / math.sqrt(n) - 0.5 / n, 0.0, 1.0))

    below, above = log_p(2.9999), log_p(3.0001)
    assert 0 < below - above < 0.01
    assert log_p(8.0) == pytest.approx(math.log(2) - 2 * 8.0**2, abs=0.01)


def test_the_cumulative_periodogram_of_a_line_steps_at_its_frequency():
    shares = cumulative_periodogram(np.sin(2 * np.pi * 20 * np.arange(200) / 200))
    assert shares[18] < 1e-9
    assert shares[19] == pytest.approx(1.0)


def test_the_cusum_finds_the_place_of_a_step_and_its_size():
    z = np.random.default_rng(0).standard_normal(1000)
    z[300:] += 1.0
    last, contrast = cusum_step(z)
    assert abs(last - 299) < 10
    # The difference of two means of 300 and 700 samples, in its standard deviations.
    assert contrast == pytest.approx(-math.sqrt(300 * 700 / 1000), abs=2.0)


@pytest.mark.parametrize("wild", [slice(0, 1), slice(0, 2), slice(998, 1000), slice(500, 502)])
def test_two_wild_samples_are_no_step(wild):
    values = np.random.default_rng(1).standard_normal(1000)
    values[wild] += 8.0
    assert mopro.reconcile(*_constant(values)).verdict == "none"


def test_a_step_of_many_samples_is_left_unexplained():
    values = np.random.default_rng(1).standard_normal(1000)
    values[:20] += 8.0
    verdict = mopro.reconcile(*_constant(values))
    assert verdict.verdict == "unexplained"
    assert "a step of -8" in verdict.remainder.description


def _constant(values):
    """A model of 0, one effect that does nothing here, and the readings `values`."""
    series = Series("run", "probe", "V", values, 1.0, np.arange(1000) / 100.0)
    return lambda _: [np.zeros(1000)], CATALOGUE[:1], [series]


def test_a_sensor_at_rest_that_shows_no_noise_is_no_disagreement():
    still = Series("run", "probe", "V", np.zeros(500), 0.1, np.arange(500) / 100.0)
    verdict = mopro.reconcile(lambda _: [np.zeros(500)], CATALOGUE[:1], [still])
    assert verdict.verdict == "none"


def test_no_frequency_is_stated_for_times_that_are_not_even():
    rng = np.random.default_rng(3)
    stamps = np.concatenate([np.arange(100.0), 100 + 15 * np.arange(800.0)])
    slow = 0.1 * np.sin(2 * np.pi * stamps / 100) + 0.1 * rng.standard_normal(900)
    series = Series("run", "thermocouple", "C", slow, 0.1, stamps)
    verdict = mopro.reconcile(lambda _: [np.zeros(900)], CATALOGUE[:1], [series])
    assert verdict.verdict == "unexplained"
    assert "a line at" not in verdict.remainder.description


def test_negative_autocorrelation_is_a_quick_scatter_and_noise():
    rng = np.random.default_rng(8)
    white = rng.standard_normal(2001)
    t = np.linspace(0.0, 1.0, 2000)
    values = SIGMA * (white[1:] - 0.5 * white[:-1]) / math.sqrt(1.25)
    series = Series("run", "force", "N", values, SIGMA, t)
    verdict = mopro.reconcile(lambda settings: [0.0 * t], [], [series])
    assert verdict.verdict == "none"
    assert verdict.remainder.description.startswith("a quick scatter in time, above")
    (note,) = verdict.notes
    assert "not white" in note
    assert "alike" not in note


@pytest.mark.parametrize("seed", range(4))
def test_slow_noise_within_the_stated_sigma_is_no_effect_but_a_note(seed):
    """Nine tenths of the stated sigma wander, which any slow signature fits."""
    rng = np.random.default_rng(seed)
    servo = Servo(samples=3000)
    data = []
    for series in servo.measure({}, 0.3 * SIGMA, seed):
        wander = autoregressive(0.98, len(series), rng)
        wander *= 0.9 * SIGMA / wander.std()
        data.append(replace(series, values=series.values + wander, sigma=SIGMA))
    verdict = mopro.reconcile(servo.predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == ("none", set())
    assert any("not white" in note for note in verdict.notes)


def with_slow_noise(servo, truth, seed, sigma, memory=0.95):
    """`servo` measured with slow noise, three times as strong as the white noise that is stated."""
    rng = np.random.default_rng([seed, 1])
    data = []
    for series in servo.measure(truth, SIGMA, seed):
        wander = autoregressive(memory, len(series), rng)
        wander *= 3 * SIGMA * math.sqrt(1 - memory**2)
        data.append(replace(series, values=series.values + wander, sigma=sigma))
    return data


TRUTH = {"coulomb": {"Fc": 2.0}, "viscous": {"b": 8.0}}


@pytest.mark.parametrize(("sigma", "expected"), [(SIGMA, "unexplained"), (None, "named")])
def test_effects_are_named_beside_slow_noise(sigma, expected):
    """Nobody stated its size where that is unknown, so that its memory is a note and no more."""
    servo = Servo(5, 1000)
    data = with_slow_noise(servo, TRUTH, 0, sigma)
    verdict = mopro.reconcile(servo.predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == (expected, set(TRUTH))
    assert ["memory" in note for note in verdict.notes] == [True] * (sigma is None)
    assert verdict.gap.noise_rms == (None if sigma is None else pytest.approx(SIGMA))


@pytest.mark.parametrize("sigma", [SIGMA, None])
def test_intervals_cover_the_truth_beside_slow_noise(sigma):
    """Taken for white, noise of this strength would make them five times as narrow."""
    servo, hits, widths = Servo(5, 1000), [], []
    effects = [candidate for candidate in CATALOGUE if candidate.name in TRUTH]
    for seed in range(60):
        residuals = Residuals(servo.predict, with_slow_noise(servo, TRUTH, seed, sigma))
        hypotheses = Hypotheses(residuals, effects)
        fit = hypotheses.fitted(effects, TRUTH)
        hypotheses.judge_by(fit)
        for (effect, p), (low, high) in zip(
            fit.order, hypotheses.evidence.intervals(fit), strict=True
        ):
            hits.append(low <= TRUTH[effect][p.name] <= high)
            widths.append((high - low) / TRUTH[effect][p.name])
    assert 0.89 <= np.mean(hits) <= 0.99
    assert np.median(widths) < 0.1


def test_effects_that_only_slow_noise_separates_are_a_family():
    """Friction that differs a little between the two directions, and friction that does not."""
    forth, back = np.tile(np.repeat([[1, 0, 0, 0], [0, 0, 1, 0]], 250, axis=1), 3).astype(float)

    def simulate(settings):
        both = settings.get("coulomb", {}).get("Fc", 0.0)
        each = settings.get("asymmetric_coulomb", {"forth": 0.0, "back": 0.0})
        return [(both + each["forth"]) * forth - (both + each["back"]) * back]

    catalogue = [c for c in CATALOGUE if c.name in ("coulomb", "asymmetric_coulomb")]
    for seed in range(8):
        rng = np.random.default_rng(seed)
        wander = autoregressive(0.97, len(forth), rng)
        values = 2.0 * (forth - back) + SIGMA * (wander + rng.standard_normal(len(forth)))
        series = Series("run", "force", "N", values, SIGMA, folds=np.arange(len(forth)) // 500)
        verdict = mopro.reconcile(simulate, catalogue, [series])
        (friction,) = verdict.effects
        assert "coulomb" in family(friction)


@pytest.mark.parametrize("truth", [{}, {"viscous": {"b": 3.0}}], ids=["none", "viscous"])
@pytest.mark.parametrize(("factor", "words"), [(0.3, "quieter than stated"), (3.0, "3 times")])
def test_white_noise_of_another_size_than_stated_is_a_note(factor, words, truth):
    """Intervals are those of the noise that the data show."""
    data = [
        replace(series, sigma=SIGMA / factor) for series in Servo().measure(truth, SIGMA, seed=0)
    ]
    verdict = mopro.reconcile(Servo().predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == ("named" if truth else "none", set(truth))
    assert verdict.notes
    assert all(words in note or "2.9 times" in note for note in verdict.notes)
    if truth:
        as_stated = mopro.reconcile(
            Servo().predict, CATALOGUE, Servo().measure(truth, SIGMA, seed=0)
        )
        widths = [np.ptp(v.effects[0].parameters["b"].ci95) for v in (verdict, as_stated)]
        assert widths[0] == pytest.approx(widths[1], rel=0.1)


def test_an_effect_below_noise_that_is_stated_too_large_is_found():
    """2 standard deviations of the stated noise in all, and 20 of the noise that is there."""
    servo, truth = Servo(), {"viscous": {"b": 0.006}}
    data = [replace(series, sigma=SIGMA) for series in servo.measure(truth, 0.1 * SIGMA, 0)]
    verdict = mopro.reconcile(servo.predict, CATALOGUE, data)
    alone = mopro.reconcile(servo.predict, CATALOGUE, servo.measure(truth, SIGMA, 0))
    assert not alone.effects
    assert names(verdict) == {"viscous"}


def test_noise_of_the_stated_size_with_a_memory_is_none_and_a_note():
    servo, answers = Servo(runs=2, samples=300), []
    for seed in range(20):
        rng = np.random.default_rng([seed, 2])
        data = []
        for series in servo.measure({}, SIGMA, seed):
            noise = autoregressive(0.8, len(series), rng) * math.sqrt(1 - 0.8**2)
            data.append(replace(series, values=0.3 + SIGMA * noise + servo_force(servo, series)))
        verdict = mopro.reconcile(servo.predict, CATALOGUE, data)
        noted = any("not white" in note for note in verdict.notes)
        answers.append((verdict.verdict, noted))
    assert answers.count(("none", True)) >= 19


def test_data_that_show_no_noise_are_said_to_be_quieter_than_stated():
    servo, rng = Servo(runs=2, samples=300), np.random.default_rng(3)
    data = [
        replace(
            s, values=servo_force(servo, s) + SIGMA / 100 * np.cumsum(rng.normal(size=len(s))) / 17
        )
        for s in servo.measure({}, SIGMA, 1)
    ]
    verdict = mopro.reconcile(servo.predict, CATALOGUE, data)
    assert verdict.verdict == "none"
    assert len(verdict.notes) == 2
    assert all("is quieter than stated" in note for note in verdict.notes)


def servo_force(servo, series):
    """The force without noise of the run that a series is of."""
    return servo.predict({})[int(series.run.split()[1])]
