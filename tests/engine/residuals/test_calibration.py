"""Stated tolerances of sensors: terms with a prior, marginalised in the whitened residual."""

import math

import numpy as np
import pytest

from mopro.engine.residuals import Residuals
from mopro.engine.residuals.calibration import Calibration, Marginal, corrected
from mopro.engine.series import Series
from mopro.engine.tolerances import LINEARITY, Tolerances
from mopro.instruments import Lvdt
from mopro.units import INCH_M

TIME_S = np.linspace(0.0, 2.0, 401)
PLACE = 7.5 - 7.5 * np.cos(math.pi * TIME_S)
SIGMA = 0.02
# The Jacobian of a model without free numbers.
NO_NUMBERS = np.zeros((len(PLACE), 0))


def series(values=PLACE, run="run", sensor="gauge", unit="in", sigma=SIGMA, **tolerances):
    stated = Tolerances(**tolerances)
    return Series(run, sensor, unit, values, sigma, time_s=TIME_S, tolerances=stated)


def problem(*data, places=(PLACE,)):
    """The residuals of data about predicted places."""
    return Residuals(lambda settings: places, data).calibrated_at({})


def test_the_residual_is_that_of_terms_fitted_at_the_price_of_their_prior():
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(60, 3)) * [0.01, 1.0, 40.0], rng.normal(size=60)
    marginal = Marginal(columns)
    white = marginal.white(residual)
    covariance = np.eye(60) + columns @ columns.T
    assert white @ white == pytest.approx(residual @ np.linalg.solve(covariance, residual))
    mean, errors = marginal.terms(white)
    known = np.linalg.inv(np.eye(3) + columns.T @ columns)
    assert errors == pytest.approx(known)
    assert mean == pytest.approx(known @ columns.T @ residual)
    fitted = rng.normal(size=(60, 2))
    both = np.hstack([columns, fitted])
    prior = np.diag([1.0, 1.0, 1.0, 0.0, 0.0])
    joint = np.linalg.inv(prior + both.T @ both)
    apart, spread = marginal.beside(
        white, np.hstack([marginal.white(f)[:, None] for f in fitted.T])
    )
    assert spread == pytest.approx(joint[:3, :3])
    assert apart == pytest.approx((joint @ both.T @ residual)[:3])
    left = residual - columns @ mean
    assert white @ white == pytest.approx(left @ left + mean @ mean)


def test_residuals_of_exact_sensors_are_what_they_were():
    """To the last bit: nothing is projected out, and no model is asked again."""
    calls = []
    data = [series(), series(run="other")]
    plain = Residuals(lambda settings: calls.append(1) or [PLACE, PLACE], data)
    assert plain.calibrated_at({}) is plain
    assert not calls
    residual = np.ones(2 * len(PLACE))
    assert plain.white(residual) is residual
    assert plain.corrected(residual, NO_NUMBERS) == ()


def test_the_bend_of_the_lvdt_of_the_emulator_is_in_its_family():
    """Its S alone, of the size that the data sheet states at the ends of the range."""
    lvdt = Lvdt(middle_m=7.5 * float(INCH_M))
    u = (PLACE - 7.5) / 10
    bent = PLACE + 2 * lvdt.linearity * 10 * u**3
    stated = 20 * lvdt.linearity
    residuals = problem(series(bent, linearity=stated, range=20.0))
    (own,) = residuals.corrected(residuals.at({}), NO_NUMBERS)
    assert (own.sensor, own.name) == ("gauge", "linearity")
    assert own.values["bend"][0] == pytest.approx(stated, rel=0.02)
    assert own.values["arc"][0] == pytest.approx(0.0, abs=1e-3)
    # The price of its prior, which has half of its variance in the arc.
    assert float(residuals.at({}) @ residuals.at({})) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(
    ("tolerances", "off"),
    [
        ({"linearity": 0.05, "range": 20.0}, 0.05 * ((PLACE - 7.5) / 10) ** 2 / math.sqrt(2)),
        ({"linearity": 0.05, "range": (0.0, 30.0)}, 0.03 * ((PLACE - 15) / 15) ** 3),
        ({"linearity": 0.05}, 0.03 * ((PLACE - 7.5) / 7.5) ** 3),
        ({"gain": 2e-3}, 2e-3 * PLACE),
        ({"clock": 3e-3}, 3e-3 * TIME_S * np.gradient(PLACE, TIME_S)),
    ],
)
@pytest.mark.parametrize("scale", [1.0, 25.4, 1e-3])
def test_what_a_tolerance_allows_leaves_noise(tolerances, off, scale):
    """In any unit; without the tolerance it does not."""
    noise = SIGMA * np.random.default_rng(3).normal(size=len(PLACE))
    read = scale * (PLACE + off + noise)
    scaled = {
        key: value
        if key in ("gain", "clock")
        else tuple(scale * end for end in value)
        if isinstance(value, tuple)
        else scale * value
        for key, value in tolerances.items()
    }
    of_scale = {"places": [scale * PLACE]}
    stated = problem(series(read, sigma=scale * SIGMA, **scaled), **of_scale)
    exact = problem(series(read, sigma=scale * SIGMA), **of_scale)
    white, left = stated.at({}), exact.at({})
    limit = len(PLACE) + 4 * math.sqrt(2 * len(PLACE))
    assert white @ white < limit
    assert left @ left > white @ white + 4
    (own,) = stated.corrected(white, NO_NUMBERS)
    assert own.log_bayes > 1.5
    assert all(low <= value <= high for value, _, (low, high) in own.values.values())


def test_a_sensor_is_off_alike_in_all_its_runs():
    """Opposite gains in two runs are none of the sensor's; the same gain in both is."""
    off = 2e-3 * PLACE

    def chi2(first, second, sensor="gauge"):
        data = [series(PLACE + first, gain=2e-3), series(PLACE + second, "b", sensor, gain=2e-3)]
        residual = problem(*data, places=(PLACE, PLACE)).at({})
        return float(residual @ residual)

    assert chi2(off, off) == pytest.approx(1.0, rel=0.02)
    assert chi2(off, -off) > 100
    assert chi2(off, -off, sensor="another") == pytest.approx(2.0, rel=0.02)


def test_a_subset_and_wild_samples_keep_the_terms():
    off = 2e-3 * PLACE
    wild = np.arange(len(PLACE)) % 7 == 0
    read = np.where(wild, 1e3, PLACE + off)
    own = Series(
        "run", "gauge", "in", read, SIGMA, TIME_S, wild=wild, tolerances=Tolerances(gain=2e-3)
    )
    residuals = problem(own)
    half = residuals.subset(TIME_S < 1.0)
    for part in (residuals, half):
        assert float(part.at({}) @ part.at({})) == pytest.approx(1.0, rel=0.05)
    (left,) = residuals.of_exact_sensors({})
    assert np.ptp(left[~wild]) < 0.1 * np.ptp(off)


def test_a_tolerance_that_nothing_calls_for_is_not_told():
    noise = SIGMA * np.random.default_rng(5).normal(size=len(PLACE))
    residuals = problem(series(PLACE + noise, linearity=0.05, gain=1e-3, clock=1e-4))
    assert residuals.corrected(residuals.at({}), NO_NUMBERS) == ()


def test_a_reading_whose_zero_is_known_has_its_gain_about_zero():
    none = np.zeros((len(PLACE), 0))
    tolerances = Tolerances(gain=0.01)
    read = 1.01 * PLACE + 0.5
    own = Series("r", "s", "in", read, SIGMA, TIME_S, nuisances=none, tolerances=tolerances)
    residuals = problem(own)
    # The half inch is none of the gain's.
    assert float(residuals.at({}) @ residuals.at({})) > 1000


@pytest.mark.parametrize("power", range(-12, 13, 3))
def test_a_term_is_known_to_the_noise_however_large_it_is(power):
    column = 10.0**power * np.ones((4, 1)) / 2
    _, covariance = Marginal(column).terms(np.ones(4))
    assert covariance[0, 0] == pytest.approx(1 / (1 + 10.0 ** (2 * power)), rel=1e-9, abs=0)


@pytest.mark.parametrize("seed", range(40))
def test_terms_of_any_sizes_are_told_in_finite_numbers(seed):
    rng = np.random.default_rng(seed)
    samples, count = int(rng.integers(2, 12)), int(rng.integers(1, 5))
    columns = rng.standard_normal((samples, count)) * 10 ** rng.uniform(-12, 12, count)
    columns[:, -1] += columns[:, 0] * rng.choice([0.0, 1.0])
    marginal = Marginal(columns)
    white = marginal.white(columns @ rng.standard_normal(count) + rng.standard_normal(samples))
    terms = tuple(("s", LINEARITY, f"p{i}", "mm", 0.1) for i in range(count))
    for own in corrected(Calibration(terms, columns), *marginal.terms(white)):
        numbers = [own.log_bayes, own.sigmas, *(v for v, *_ in own.values.values())]
        assert np.isfinite(numbers).all()
