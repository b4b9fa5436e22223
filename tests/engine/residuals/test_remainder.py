"""Tests of what a fit leaves: shapes that hide in the noise, and what they are a function of."""

import math

import numpy as np
import pytest
from scipy import signal

from mopro.engine import Series
from mopro.engine.residuals import Residuals
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.residuals.noise_tests import chi2_log_p, line_log_p
from mopro.engine.residuals.remainder import as_noise, examine, noise_of

RATE_HZ = 1000.0
TIME = np.arange(4000) / RATE_HZ
# Out and back, twice, with rests.
VELOCITY = np.select([TIME % 2 < 0.7, TIME % 2 < 1.0, TIME % 2 < 1.7], [0.3, 0.0, -0.3], 0.0)
PLACE = np.cumsum(VELOCITY) / RATE_HZ


def residuals_of(values, sigma=1.0, runs=(0, 1), predicted=0.0):
    """`values` and white noise of variance 1, the same in two runs, where `predicted` is."""
    data = []
    for run in runs:
        noise = np.random.default_rng(run).standard_normal(len(TIME))
        labels = {"position": PLACE, "velocity": VELOCITY, "acceleration": np.gradient(VELOCITY)}
        data.append(
            Series(
                f"run {run}", "laser", "m", noise + values + predicted, sigma, TIME, labels=labels
            )
        )
    return Residuals(lambda settings: [predicted + np.zeros(len(TIME))] * 2, data)


def remainder(values, sigma=1.0, runs=(0, 1)):
    """The tested remainder of `values` and white noise of variance 1, the same in two runs."""
    residuals = residuals_of(values, sigma, runs)
    return examine(residuals, residuals.at({}), 0)


def test_noise_alone_is_noise():
    assert not remainder(np.zeros(len(TIME))).significant


@pytest.mark.parametrize(("freedom", "rss"), [(2, 300.0), (2, 5000.0), (4, 5000.0), (4, 9000.0)])
def test_chi_squared_is_tested_far_beyond_the_smallest_number(freedom, rss):
    """Closed forms: exp(-s/2) for two degrees of freedom, exp(-s/2) (1 + s/2) for four."""
    exact = -rss / 2 + (math.log1p(rss / 2) if freedom == 4 else 0.0)
    assert chi2_log_p(rss, freedom) == pytest.approx(exact, rel=1e-9, abs=1e-6)
    assert line_log_p(rss / 2, 1, freedom // 2) == pytest.approx(exact, rel=1e-9, abs=1e-6)


def test_rings_that_add_little_to_the_noise_are_found_by_their_band():
    """4 % of the power of the noise, around 75 Hz: no line of it is strong by itself."""
    band = signal.butter(4, (65, 88), "bandpass", fs=RATE_HZ, output="sos")
    found = []
    for seed in range(8):
        ring = signal.sosfilt(band, np.random.default_rng(seed).standard_normal(len(TIME)))
        answer = remainder(0.2 * ring / ring.std(), runs=(2 * seed, 2 * seed + 1))
        found.append(answer.significant and answer.variable == "t")
    assert sum(found) >= 7


@pytest.mark.parametrize("sigma", [1.0, None])
def test_scatter_that_grows_with_the_speed_is_a_law_of_v(sigma):
    """As the times of a clock with jitter have it."""
    jitter = np.random.default_rng(8).standard_normal(len(TIME))
    answer = remainder(0.6 * jitter * np.abs(VELOCITY) / 0.3, sigma)
    assert (answer.significant, answer.variable) == (True, "v")


@pytest.mark.parametrize("slow", [False, True])
def test_unknown_noise_has_a_memory_only_where_neighbours_are_alike(slow):
    noise = np.random.default_rng(8).standard_normal(len(TIME))
    walk = 0.05 * np.cumsum(noise)
    left = walk if slow else 0.6 * noise * np.abs(VELOCITY) / 0.3
    residuals = residuals_of(left, None, predicted=1e3 * PLACE)
    residual = residuals.at({})
    found = examine(residuals, residual, 0)
    note = as_noise(residuals, Noise.as_stated(residuals), residual, found)
    expected = (
        "the noise has a memory: neighbouring samples are alike"
        if slow
        else "the noise is white but for scatter that grows with the speed v"
    )
    assert note == expected


@pytest.mark.parametrize(("white", "seed"), [(0.0, 0), (1 / 3, 0), (1 / 3, 1), (1 / 3, 2)])
@pytest.mark.parametrize(("share", "told"), [(0.3, False), (0.05, True)])
def test_a_tenth_of_the_signal_that_is_no_noise_of_the_neighbours_is_no_noise(
    share, told, white, seed
):
    """A slow wave with a period that drifts, in a sensor of unknown noise, `white` of its size."""
    left = share * 1e3 * PLACE.std() * math.sqrt(2) * np.sin(9 * TIME + TIME**2)
    left = left + white * left.std() * np.random.default_rng(seed).standard_normal(len(TIME))
    residuals = residuals_of(left, None, predicted=1e3 * PLACE)
    residual = residuals.at({})
    found = examine(residuals, residual, 0)
    assert found.significant
    note = as_noise(residuals, Noise.as_stated(residuals), residual, found)
    assert (note is not None) == told


@pytest.mark.parametrize("memory", [0.5, 0.9, 0.97])
def test_noise_with_a_memory_that_neighbours_show_is_noise_however_large(memory):
    noise = np.random.default_rng(8).standard_normal(len(TIME))
    own = signal.lfilter([1.0], [1.0, -memory], noise)
    residuals = residuals_of(30 * own, None, predicted=1e3 * PLACE)
    residual = residuals.at({})
    note = as_noise(
        residuals, Noise.as_stated(residuals), residual, examine(residuals, residual, 0)
    )
    assert note == "the noise has a memory: neighbouring samples are alike"


def test_a_sensor_that_is_quieter_at_rest_does_not_scatter_with_the_speed():
    """One that stands between two of its steps, for instance."""
    still = VELOCITY == 0
    noise = np.random.default_rng(0).standard_normal(len(TIME))
    assert not remainder(np.where(still, -0.1 * noise, 0.0)).significant


@pytest.mark.parametrize("seed", range(4))
def test_white_noise_larger_than_stated_does_not_scatter_with_the_speed(seed):
    """Squares of three times the noise scatter nine times as much as those of the noise."""
    found = remainder(np.zeros(len(TIME)), 0.3, (2 * seed, 2 * seed + 1))
    assert (found.significant, found.only_size) == (True, True)
    assert found.scatter == pytest.approx(1 / 0.3, rel=0.03)


def test_noise_with_a_memory_is_not_white_where_its_times_are_unknown():
    wander = signal.lfilter([1.0], [1.0, -0.95], np.random.default_rng(3).standard_normal(2000))
    residuals = Residuals(lambda settings: [0 * wander], [Series("run", "force", "N", wander, 1.0)])
    found = examine(residuals, residuals.at({}), 0)
    assert (found.significant, found.only_size) == (True, False)


def test_scatter_that_grows_with_the_speed_is_found_beside_a_larger_noise():
    jitter = np.random.default_rng(8).standard_normal(len(TIME))
    assert remainder(0.6 * jitter * np.abs(VELOCITY) / 0.3, 0.3).variable == "v"


def test_white_noise_larger_than_stated_is_white_noise_of_unknown_size():
    """Its likelihood is n ln(sum / n), which one line in n frequencies changes little."""
    residuals = residuals_of(np.zeros(len(TIME)), 0.3)
    residual = residuals.at({})
    noise = noise_of(residuals, residual, 0)
    assert noise.exact
    line = np.sin(2 * np.pi * 80 * TIME)
    own = residual[: len(TIME)]
    without = own - line * (line @ own) / (line @ line)
    gained = noise.deviance(residual) - noise.deviance(np.concatenate([without, residual[4000:]]))
    fall = (own @ own - without @ without) / np.var(own)
    assert gained == pytest.approx(fall, rel=0.01)


def test_a_line_over_place_is_told_from_another_function_of_it():
    reach = np.ptp(PLACE)
    line = 0.5 * np.sin(2 * np.pi * PLACE * 10 / reach)
    assert remainder(line).variable == "x mod"
    saw = 2.0 * ((3.3 * PLACE / reach) % 1.0)
    assert remainder(saw).variable == "x"


def test_the_offsets_of_short_runs_are_no_freedom_of_the_size_of_the_noise():
    """Fifty runs of two readings, whose offsets leave fifty: 1.5 times the noise is too much."""
    values = 1.5 * np.random.default_rng(4).standard_normal((50, 2))
    data = [Series(f"run {i}", "probe", "V", own, 1.0) for i, own in enumerate(values)]
    residuals = Residuals(lambda settings: [np.zeros(2)] * 50, data)
    found = examine(residuals, residuals.at({}), 0)
    rss = float(np.sum(np.diff(values) ** 2)) / 2
    assert found.p_value == pytest.approx(math.exp(chi2_log_p(rss / 1.05**2, 50)))
    assert found.significant
