"""Fits on closed forms: slopes along the way and at the end, and rivals that are given up."""

import math

import numpy as np
import pytest

from mopro.diagnosis import Candidate, Parameter, Role, Series
from mopro.diagnosis.descent import Descent
from mopro.diagnosis.fit import fit
from mopro.diagnosis.fits import Fits
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.search import Search
from mopro.diagnosis.slopes import Slopes

TIME_S = np.linspace(0.0, 2.0, 400)
SIGMA = 0.01
DECAY = Candidate(
    "decay",
    (Parameter("height", "V", 0.0, 10.0, (1.0,)), Parameter("rate", "1/s", 0.1, 20.0, (2.0,))),
)
FAST = Candidate(
    "decay", (DECAY.parameters[0], Parameter("rate", "1/s", 8.0, 20.0, (9.0,))), form="fast"
)
TRUTH = {"decay": {"height": 2.0, "rate": 3.0}}


def decaying(settings):
    decay = settings.get("decay", {})
    return [decay.get("height", 0.0) * np.exp(-decay.get("rate", 0.0) * TIME_S)]


def problem(model):
    (clean,) = model(TRUTH)
    noisy = clean + SIGMA * np.random.default_rng(3).standard_normal(len(clean))
    series = Series("run", "probe", "V", noisy, SIGMA, nuisances=np.zeros((len(clean), 0)))
    return Residuals(model, [series])


def test_the_errors_are_those_of_the_slopes_where_the_fit_ends():
    found = fit(problem(decaying), [DECAY], [{"decay": {"height": 1.0, "rate": 1.0}}])
    height, rate = found.settings["decay"].values()
    assert (height, rate) == pytest.approx((2.0, 3.0), abs=0.03)
    fall = np.exp(-rate * TIME_S) / SIGMA
    closed = np.array([-fall, height * TIME_S * fall]).T
    assert np.abs(found.jacobian - closed).max() < 0.02 * np.abs(closed).max()
    errors = np.sqrt(np.diag(np.linalg.inv(closed.T @ closed)))
    assert found.deviations() == pytest.approx(errors, rel=0.02)


def test_a_straight_problem_takes_its_slopes_once_along_the_way():
    matrix = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.2]])
    asked = []

    def residual(x):
        asked.append(x)
        return matrix @ x - 1.0

    slopes = Slopes(residual, (1e-3, 1e-3))
    assert slopes.at(np.array([0.2, 0.8])) == pytest.approx(matrix)
    asked.clear()
    assert slopes.at(np.array([0.4, 0.3])) == pytest.approx(matrix)
    assert len(asked) == 1, "the residual there, and no difference"
    slopes.forget()
    slopes.at(np.array([0.4, 0.3]))
    assert len(asked) == 4


def test_a_bent_one_corrects_its_slopes_by_what_a_step_tells():
    def residual(x):
        return 100 * np.array([x[0] + 0.1 * x[0] ** 2, x[1], x[0] * x[1]])

    slopes = Slopes(residual, (1e-4, 1e-4))
    start, end = np.array([0.1, 0.2]), np.array([0.2, 0.25])
    before = slopes.at(start)
    assert not slopes.corrected
    after = slopes.at(end)
    assert slopes.corrected
    assert after @ (end - start) == pytest.approx(residual(end) - residual(start))
    assert not np.allclose(before @ (end - start), residual(end) - residual(start))
    far = np.array([0.9, 0.9])
    assert not np.allclose(after, slopes.at(far))
    assert not slopes.corrected, "the step was ill foretold: differences anew"


def test_a_rival_that_cannot_come_near_is_given_up_and_asked_anew_when_it_matters():
    residuals = problem(decaying)
    best = fit(residuals, [DECAY], [TRUTH])
    start = {"decay": {"height": 9.0, "rate": 19.0}}
    whole = fit(residuals, [FAST], [start])
    assert not whole.hopeless
    assert whole.rss > 100 * best.rss
    fits = Fits(residuals, [DECAY, FAST])
    hopeless = fits.fitted([FAST], [start], best.rss + 100)
    assert hopeless.hopeless
    assert hopeless.rss >= whole.rss
    assert fits.fitted([FAST], [start], best.rss + 100) is hopeless
    again = fits.fitted([FAST], [start])
    assert not again.hopeless
    assert again.rss == pytest.approx(whole.rss)
    near = fits.fitted([DECAY], [{"decay": {"height": 9.0, "rate": 0.2}}], best.rss + 100)
    assert not near.hopeless
    assert math.isclose(near.rss, best.rss, rel_tol=1e-3)


def test_a_kink_is_found_without_halving_steps_for_ever():
    asked = []

    def residual(x):
        asked.append(x)
        return np.array([100 * abs(x[0] - 0.3) + 10, 50 * (x[0] - 0.5)])

    place = Descent(residual, (1e-4,), math.inf).run(
        np.array([0.9]), np.zeros(1), np.ones(1), tolerance=1e-4
    )
    assert place.x[0] == pytest.approx(0.3, abs=0.03)
    assert len(asked) < 40


@pytest.mark.parametrize(
    ("deviations", "price", "plausible"),
    [
        (-39.0, 0.0, True),
        (-3.0, 0.0, True),
        (1.0, 1.0, True),
        (1.9, 3.61, True),
        (2.1, 4.41, False),
        (9.0, 10.0, False),
    ],
)
def test_an_implausible_value_costs_what_moving_it_into_its_range_would(
    deviations, price, plausible
):
    error = SIGMA / math.sqrt(len(TIME_S))
    # The end of a range is a round number, taken to within a hundredth of the range.
    level = np.full(len(TIME_S), 1.0 + 0.02 + deviations * error)
    series = Series("run", "probe", "V", level, SIGMA, nuisances=np.zeros((len(level), 0)))
    residuals = Residuals(lambda s: [s.get("level", {}).get("v", 0.0) + 0 * TIME_S], [series])

    def fitted(expected):
        anywhere = Parameter("v", "V", -5.0, 5.0, (0.5,), plausible=expected)
        return fit(residuals, [Candidate("level", (anywhere,))], [{"level": {"v": 0.5}}])

    found = fitted((-1.0, 1.0))
    assert found.cost(1) - fitted(None).cost(1) == pytest.approx(price, abs=0.02)
    assert found.plausible is plausible


def test_a_rival_given_up_for_one_limit_is_fitted_anew_for_a_wider_one():
    residuals = problem(decaying)
    best = fit(residuals, [DECAY], [TRUTH])
    start = {"decay": {"height": 9.0, "rate": 19.0}}
    fits = Fits(residuals, [DECAY, FAST])
    assert fits.fitted([FAST], [start], best.rss + 100).hopeless
    wider = fits.fitted([FAST], [start], 1e12)
    assert not wider.hopeless
    assert fits.fitted([FAST], [start], best.rss + 100) is wider


def test_what_is_in_the_model_s_tolerance_is_no_choice_that_costs():
    error = SIGMA / math.sqrt(len(TIME_S))

    def chosen(value, tolerated):
        level = np.full(len(TIME_S), value)
        series = Series("run", "probe", "V", level, SIGMA, nuisances=np.zeros((len(level), 0)))
        residuals = Residuals(lambda s: [s.get("level", {}).get("v", 0.0) + 0 * TIME_S], [series])
        number = Parameter("v", "V", -5.0, 5.0, (0.5,), tolerated=tolerated)
        found = fit(residuals, [Candidate("level", (number,))], [{"level": {"v": 0.5}}])
        return found.chosen, found.cost(50) - found.misfit - found.price

    assert chosen(1.0, None) == (1, pytest.approx(2 * math.log(50)))
    assert chosen(0.5, (-1.0, 1.0)) == (0, 0.0)
    assert chosen(1.0 + error, (-1.0, 1.0)) == (0, 0.0)
    assert chosen(1.0 + 3 * error, (-1.0, 1.0)) == (1, pytest.approx(2 * math.log(50)))


def test_fewer_samples_than_it_takes_to_tell_their_noise_are_worth_nothing():
    def model(settings):
        return [settings.get("line", {}).get("v", 0.0) * np.arange(3.0)]

    line = Candidate("line", (Parameter("v", "V", -5.0, 5.0, (0.5,)),))
    residuals = Residuals(model, [Series("run", "probe", "V", np.array([0.0, 1.0, 2.1]), None)])
    assert residuals.count == 2
    assert fit(residuals, [line], [{"line": {"v": 0.5}}]).cost(1) == math.inf


def waves(settings):
    return [sum(w["A"] * np.sin(w["w"] * TIME_S) for w in settings.values()) + 0.0 * TIME_S]


def wave(name):
    height = Parameter("A", "V", -5.0, 5.0, (0.5,))
    return Candidate(name, (height, Parameter("w", "rad/s", 1.0, 60.0, (9.0,), Role.SHAPE)))


def test_a_fit_that_ended_in_a_hollow_is_begun_anew_where_a_wider_one_leads():
    """A frequency far off goes nowhere; with another wave beside it the right one was found."""
    rng = np.random.default_rng(5)
    (clean,) = waves({"main": {"A": 1.0, "w": 30.0}})
    noisy = clean + SIGMA * rng.standard_normal(len(clean))
    series = Series("run", "probe", "V", noisy, SIGMA, nuisances=np.zeros((len(clean), 0)))
    fits = Fits(Residuals(waves, [series]), [wave("main"), wave("other")])
    hollow = fits.fitted([wave("main")], [{"main": {"A": 0.3, "w": 9.0}}])
    assert hollow.rss > 1000 * hollow.count
    both = fits.fitted(
        [wave("main"), wave("other")],
        [{"main": {"A": 1.1, "w": 29.5}, "other": {"A": 0.2, "w": 12.0}}],
    )
    alone = fits.without(both, "other")
    assert alone.rss == pytest.approx(alone.count, rel=0.2)
    assert alone.settings["main"]["w"] == pytest.approx(30.0, abs=0.01)
    assert fits.without(both, "other") is alone
    assert fits.fitted([wave("main")], [{"main": {"A": 0.3, "w": 9.0}}]) is alone


def test_where_the_others_go_without_an_effect_is_what_a_straight_fit_of_them_finds():
    rng = np.random.default_rng(6)
    shapes = {name: rng.standard_normal(len(TIME_S)) for name in ("a", "b", "c")}
    shapes["c"] += 0.8 * shapes["a"]

    def model(settings):
        return [sum(v["v"] * shapes[name] for name, v in settings.items()) + 0.0 * TIME_S]

    number = Parameter("v", "V", -50.0, 50.0, (0.5,))
    a, b, c = (Candidate(name, (number,)) for name in shapes)
    (clean,) = model({"a": {"v": 1.0}, "b": {"v": -2.0}, "c": {"v": 0.5}})
    series = Series(
        "run", "probe", "V", clean + SIGMA * rng.standard_normal(len(clean)), SIGMA,
        nuisances=np.zeros((len(clean), 0)),
    )  # fmt: skip
    residuals = Residuals(model, [series])
    start = {name: {"v": 0.0} for name in shapes}
    led = fit(residuals, [a, b, c], [start]).others_without("c")
    alone = fit(residuals, [a, b], [{"a": {"v": 0.0}, "b": {"v": 0.0}}]).settings
    assert set(led) == {"a", "b"}
    for name in led:
        assert led[name]["v"] == pytest.approx(alone[name]["v"], abs=1e-6)


@pytest.mark.parametrize(("beyond", "named"), [(-1.0, set()), (4.0, set()), (5.2, {"line"})])
def test_an_effect_is_named_that_pays_ten_times_over(beyond, named):
    """What it gains in chi-squared, beyond the price of its parameter, is 2 ln of the odds."""
    rng = np.random.default_rng(7)
    shape = np.sin(5 * TIME_S) / np.linalg.norm(np.sin(5 * TIME_S))
    noise = rng.standard_normal(len(TIME_S))
    noise -= shape * (shape @ noise)
    values = SIGMA * (noise + shape * math.sqrt(math.log(len(TIME_S)) + beyond))
    series = Series("run", "probe", "V", values, SIGMA, nuisances=np.zeros((len(TIME_S), 0)))
    line = Candidate("line", (Parameter("v", "V", -1.0, 1.0, (0.01,)),))
    residuals = Residuals(lambda s: [s.get("line", {"v": 0.0})["v"] * shape], [series])
    assert Search(Fits(residuals, [line])).run().names == named


@pytest.mark.parametrize("alike", [True, False])
def test_what_shows_in_one_move_only_is_borne_out_by_the_rest_of_it(alike):
    """After a step the run's offset takes the level: the last move alone tells its height."""
    rng = np.random.default_rng(9)
    t = np.linspace(0.0, 3.0, 3000)
    grown = np.clip(t - 2.2, 0.0, 0.4)
    bent = np.where(t > 2.4, 2 * 0.2 - grown, grown)

    def model(settings):
        return [settings.get("growth", {"v": 0.0})["v"] * grown]

    values = (grown if alike else bent) + SIGMA * rng.standard_normal(len(t))
    series = Series("run", "probe", "V", values, SIGMA, folds=np.minimum(t.astype(int), 2))
    residuals = Residuals(model, [series])
    growth = Candidate("growth", (Parameter("v", "V/s", -5.0, 5.0, (0.5,)),))
    fits = Fits(residuals, [growth])
    found = fits.fitted([growth], [{"growth": {"v": 0.5}}])
    held = fits.held_out(found)
    assert held.supports("growth") is alike
    assert (held.after < 1.1) is alike
