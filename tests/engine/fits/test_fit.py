"""Least-squares fits of closed forms: Jacobians, errors, evidence, and what is abandoned."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, measured, of_size, sizes, times
from mopro.engine import Candidate, Parameter, Role, Series
from mopro.engine.assumed import LINEARITY_ERROR
from mopro.engine.fits import (
    Descent,
    Evidence,
    Fit,
    Limit,
    SecantJacobian,
    least_squares_fit,
    with_central_jacobian,
)
from mopro.engine.residuals import Residuals
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.search.hypotheses import Hypotheses

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


def as_stated(residuals, *candidates):
    """The evidence of a catalogue by the stated noise."""
    return Evidence(Noise.as_stated(residuals), [candidate.key for candidate in candidates])


def test_the_errors_are_those_of_the_jacobian_at_the_minimum():
    residuals = problem(decaying)
    fit = least_squares_fit(residuals, [DECAY], [{"decay": {"height": 1.0, "rate": 1.0}}])
    height, rate = fit.settings["decay"].values()
    assert (height, rate) == pytest.approx((2.0, 3.0), abs=0.03)
    fall = np.exp(-rate * TIME_S) / SIGMA
    closed = np.array([-fall, height * TIME_S * fall]).T
    assert np.abs(fit.jacobian - closed).max() < 0.02 * np.abs(closed).max()
    errors = np.sqrt(np.diag(np.linalg.inv(closed.T @ closed)))
    assert as_stated(residuals, DECAY).deviations(fit) == pytest.approx(errors, rel=0.02)


def test_a_central_jacobian_errs_by_the_square_of_the_step():
    """By h² / 6 of the third derivative; to one side, by h / 2 of the second."""
    residuals = problem(decaying)
    fit = least_squares_fit(residuals, [DECAY], [{"decay": {"height": 1.0, "rate": 1.0}}])
    height, rate = fit.settings["decay"].values()
    closed = height * TIME_S * np.exp(-rate * TIME_S) / SIGMA
    step = 1e-3 * (20.0 - 0.1)
    central = with_central_jacobian(residuals, fit)
    missed = np.abs(central.jacobian[:, 1] - closed).max()
    assert missed == pytest.approx(np.abs(step**2 / 6 * TIME_S**2 * closed).max(), rel=0.1)
    assert np.abs(fit.jacobian[:, 1] - closed).max() > 50 * missed


def test_a_central_jacobian_asks_for_no_prediction_outside_of_a_range():
    """A number at the end of its range is changed to the inner side only."""
    rates = []

    def watched(settings):
        rates.append(settings.get("decay", {}).get("rate", 8.0))
        return decaying(settings)

    residuals = problem(watched)
    fit = least_squares_fit(residuals, [FAST], [{"decay": {"height": 1.0, "rate": 9.0}}])
    assert fit.settings["decay"]["rate"] == pytest.approx(8.0, abs=1e-3)
    rates.clear()
    with_central_jacobian(residuals, fit)
    assert len(set(rates)) == 2
    assert min(rates) >= 8.0


def test_the_jacobian_of_a_linear_residual_is_taken_by_differences_once():
    matrix = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.2]])
    asked = []

    def residual(x):
        asked.append(x)
        return matrix @ x - 1.0

    jacobian = SecantJacobian(residual, (1e-3, 1e-3))
    assert jacobian.at(np.array([0.2, 0.8])) == pytest.approx(matrix)
    asked.clear()
    assert jacobian.at(np.array([0.4, 0.3])) == pytest.approx(matrix)
    assert len(asked) == 1, "the residual there, and no difference"
    jacobian.forget()
    jacobian.at(np.array([0.4, 0.3]))
    assert len(asked) == 4


def test_the_jacobian_of_a_curved_residual_is_updated_by_each_step_that_it_predicted():
    def residual(x):
        return 100 * np.array([x[0] + 0.1 * x[0] ** 2, x[1], x[0] * x[1]])

    jacobian = SecantJacobian(residual, (1e-4, 1e-4))
    start, end = np.array([0.1, 0.2]), np.array([0.2, 0.25])
    before = jacobian.at(start)
    assert not jacobian.updated
    after = jacobian.at(end)
    assert jacobian.updated
    assert after @ (end - start) == pytest.approx(residual(end) - residual(start))
    assert not np.allclose(before @ (end - start), residual(end) - residual(start))
    far = np.array([0.9, 0.9])
    assert not np.allclose(after, jacobian.at(far))
    assert not jacobian.updated, "the step was predicted badly: differences again"


def test_a_fit_that_cannot_come_down_to_its_limit_is_abandoned_and_fitted_again_without_one():
    residuals = problem(decaying)
    best = least_squares_fit(residuals, [DECAY], [TRUTH])
    start = {"decay": {"height": 9.0, "rate": 19.0}}
    whole = least_squares_fit(residuals, [FAST], [start])
    assert not whole.abandoned
    assert whole.rss > 100 * best.rss
    fits = Hypotheses(residuals, [DECAY, FAST])
    abandoned = fits.fitted([FAST], start, Limit(best.rss + 100))
    assert abandoned.abandoned
    assert abandoned.rss >= whole.rss
    assert fits.fitted([FAST], start, Limit(best.rss + 100)) is abandoned
    again = fits.fitted([FAST], start)
    assert not again.abandoned
    assert again.rss == pytest.approx(whole.rss)
    near = fits.fitted([DECAY], {"decay": {"height": 9.0, "rate": 0.2}}, Limit(best.rss + 100))
    assert not near.abandoned
    assert math.isclose(near.rss, best.rss, rel_tol=1e-3)


def test_the_minimum_at_a_kink_is_found_in_few_evaluations():
    asked = []

    def residual(x):
        asked.append(x)
        return np.array([100 * abs(x[0] - 0.3) + 10, 50 * (x[0] - 0.5)])

    reached = Descent(residual, (1e-4,)).run(
        np.array([0.9]), np.zeros(1), np.ones(1), tolerance=1e-4
    )
    assert reached.x[0] == pytest.approx(0.3, abs=0.03)
    assert len(asked) < 40


@pytest.mark.parametrize(
    ("deviations", "penalty", "plausible"),
    [
        (-39.0, 0.0, True),
        (-3.0, 0.0, True),
        (1.0, 1.0, True),
        (1.9, 3.61, True),
        (2.1, 4.41, True),
        (3.3, 10.0, False),
        (9.0, 10.0, False),
    ],
)
def test_the_penalty_of_an_implausible_value_is_the_chi2_of_moving_it_into_its_range(
    deviations, penalty, plausible
):
    error = SIGMA / math.sqrt(len(TIME_S))
    # The end of a range is a round number, taken to within 5 % of the range.
    level = np.full(len(TIME_S), 1.0 + 0.1 + deviations * error)
    series = Series("run", "probe", "V", level, SIGMA, nuisances=np.zeros((len(level), 0)))
    residuals = Residuals(lambda s: [s.get("level", {}).get("v", 0.0) + 0 * TIME_S], [series])

    def fitted(expected):
        anywhere = Parameter("v", "V", -5.0, 5.0, (0.5,), plausible=expected)
        return least_squares_fit(
            residuals, [Candidate("level", (anywhere,))], [{"level": {"v": 0.5}}]
        )

    fit, evidence = fitted((-1.0, 1.0)), as_stated(residuals)
    anywhere = as_stated(residuals).ebic(fitted(None))
    assert evidence.ebic(fit) - anywhere == pytest.approx(penalty, abs=0.02)
    assert evidence.implausible(fit) == (set() if plausible else {"level.v"})


def test_a_value_that_its_range_stops_beyond_the_plausible_costs_ten():
    level = np.full(len(TIME_S), 6.0)
    series = Series("run", "probe", "V", level, 50.0, nuisances=np.zeros((len(level), 0)))
    residuals = Residuals(lambda s: [s.get("level", {}).get("v", 0.0) + 0 * TIME_S], [series])

    def fitted(expected):
        number = Parameter("v", "V", -5.0, 5.0, (0.5,), plausible=expected)
        return least_squares_fit(
            residuals, [Candidate("level", (number,))], [{"level": {"v": 0.5}}]
        )

    evidence = as_stated(residuals)
    stopped = fitted((-1.0, 1.0))
    assert evidence.at_bound(stopped) == ["level.v"]
    assert evidence.ebic(stopped) - evidence.ebic(fitted((-5.0, 5.0))) == pytest.approx(0.0)
    assert evidence.penalty(stopped) - math.log(len(TIME_S)) == pytest.approx(10.0)


def test_an_amplitude_that_is_off_at_infinity_is_off_to_first_order():
    """A slow sensor, whose corner frequency is fitted as its inverse, and the lag that it makes."""
    t = np.linspace(0.0, 5.0, 2000)

    def simulate(settings):
        lag_s = 1 / (math.tau * settings.get("slow", {}).get("f", math.inf))
        return [np.sin(t) - lag_s * np.cos(t)]

    corner = Parameter("f", "Hz", 1.0, 1e6, (10.0,), inverse=True, null=math.inf)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    data = [Series("run", "probe", "V", simulate({"slow": {"f": 5.0}})[0] + noise, 1e-3, t)]
    residuals = Residuals(simulate, data)
    fit = least_squares_fit(residuals, [Candidate("slow", (corner,))], [{"slow": {"f": 8.0}}])
    change = residuals.at({}) - fit.residual
    assert fit.linear_part("slow") == pytest.approx(change, abs=1e-2 * float(np.abs(change).max()))


def test_of_equal_sets_the_one_of_fewer_numbers_is_the_simplest_and_constants_do_not_count():
    def parameters(*roles):
        return tuple(Parameter(f"p{i}", "V", -5.0, 5.0, role=r) for i, r in enumerate(roles))

    def chosen(*roles, searched=0):
        own = parameters(*roles)
        effect = Candidate("effect", own)
        order = tuple(("effect", p) for p in own)
        return Fit(
            (effect,), (), order, {}, np.zeros(9), np.zeros((9, len(own))), 9, searched
        ).chosen

    assert chosen(Role.AMPLITUDE) == chosen(Role.AMPLITUDE, Role.CONSTANT) == 1
    assert chosen(Role.AMPLITUDE, searched=1) == chosen(Role.AMPLITUDE, Role.SHAPE) == 2


def test_a_fit_abandoned_for_one_limit_is_fitted_again_for_a_wider_one():
    residuals = problem(decaying)
    best = least_squares_fit(residuals, [DECAY], [TRUTH])
    start = {"decay": {"height": 9.0, "rate": 19.0}}
    fits = Hypotheses(residuals, [DECAY, FAST])
    assert fits.fitted([FAST], start, Limit(best.rss + 100)).abandoned
    wider = fits.fitted([FAST], start, Limit(1e12))
    assert not wider.abandoned
    assert fits.fitted([FAST], start, Limit(best.rss + 100)) is wider


def test_a_value_within_the_tolerance_of_the_model_has_no_penalty_of_choice():
    error = SIGMA / math.sqrt(len(TIME_S))

    def findings_and_penalty(value, tolerated):
        level = np.full(len(TIME_S), value)
        series = Series("run", "probe", "V", level, SIGMA, nuisances=np.zeros((len(level), 0)))
        residuals = Residuals(lambda s: [s.get("level", {}).get("v", 0.0) + 0 * TIME_S], [series])
        number = Parameter("v", "V", -5.0, 5.0, (0.5,), tolerated=tolerated)
        fit = least_squares_fit(residuals, [Candidate("level", (number,))], [{"level": {"v": 0.5}}])
        evidence = Evidence(Noise.as_stated(residuals), [(f"effect {i}", "") for i in range(50)])
        return evidence.findings(fit), evidence.ebic(fit) - fit.rss - math.log(len(TIME_S))

    assert findings_and_penalty(1.0, None) == (1, pytest.approx(2 * math.log(50)))
    assert findings_and_penalty(0.5, (-1.0, 1.0)) == (0, pytest.approx(0.0))
    assert findings_and_penalty(1.0 + error, (-1.0, 1.0)) == (0, pytest.approx(0.0))
    assert findings_and_penalty(1.0 + 3 * error, (-1.0, 1.0)) == (
        1,
        pytest.approx(2 * math.log(50)),
    )


def test_the_ebic_is_infinite_where_samples_are_too_few_to_estimate_their_noise():
    def model(settings):
        return [settings.get("line", {}).get("v", 0.0) * np.arange(3.0)]

    line = Candidate("line", (Parameter("v", "V", -5.0, 5.0, (0.5,)),))
    residuals = Residuals(model, [Series("run", "probe", "V", np.array([0.0, 1.0, 2.1]), None)])
    assert residuals.count == 2
    fit = least_squares_fit(residuals, [line], [{"line": {"v": 0.5}}])
    assert as_stated(residuals, line).ebic(fit) == math.inf


def waves(settings):
    return [sum(w["A"] * np.sin(w["w"] * TIME_S) for w in settings.values()) + 0.0 * TIME_S]


def wave(name):
    height = Parameter("A", "V", -5.0, 5.0, (0.5,))
    return Candidate(name, (height, Parameter("w", "rad/s", 1.0, 60.0, (9.0,), Role.SHAPE)))


def test_a_local_minimum_is_replaced_by_the_one_that_a_wider_fit_leads_to():
    """From 9 rad/s the fit never comes to 30 rad/s; with a second wave it began near there."""
    rng = np.random.default_rng(5)
    (clean,) = waves({"main": {"A": 1.0, "w": 30.0}})
    noisy = clean + SIGMA * rng.standard_normal(len(clean))
    series = Series("run", "probe", "V", noisy, SIGMA, nuisances=np.zeros((len(clean), 0)))
    fits = Hypotheses(Residuals(waves, [series]), [wave("main"), wave("other")])
    local = fits.fitted([wave("main")], {"main": {"A": 0.3, "w": 9.0}})
    assert local.rss > 1000 * local.count
    both = fits.fitted(
        [wave("main"), wave("other")],
        {"main": {"A": 1.1, "w": 29.5}, "other": {"A": 0.2, "w": 12.0}},
    )
    alone = fits.without(both, "other")
    assert alone.rss == pytest.approx(alone.count, rel=0.2)
    assert alone.settings["main"]["w"] == pytest.approx(30.0, abs=0.01)
    assert fits.without(both, "other") is alone
    assert fits.fitted([wave("main")], {"main": {"A": 0.3, "w": 9.0}}) is alone


def test_the_others_without_an_effect_are_those_of_a_linear_fit_of_them():
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
    fit = least_squares_fit(residuals, [a, b, c], [start])
    alone = least_squares_fit(residuals, [a, b], [{"a": {"v": 0.0}, "b": {"v": 0.0}}])
    predicted = fit.stepped_without("c")
    assert set(predicted) == {"a", "b"}
    for name in predicted:
        assert predicted[name]["v"] == pytest.approx(alone.settings[name]["v"], abs=1e-6)
    assert fit.residual_without("c") == pytest.approx(alone.residual, abs=1e-5)


@pytest.mark.parametrize("rate", [1.0, 3.0, 5.5])
def test_a_fit_begins_with_the_very_values_that_it_is_given(rate):
    """So that a start which was simulated before need not be simulated again."""
    asked = []

    def simulate(settings):
        asked.append(settings)
        return decaying(settings)

    start = {"decay": {"height": 1.1, "rate": rate}}
    residuals = problem(simulate)
    asked.clear()
    least_squares_fit(residuals, [DECAY], [start])
    assert asked[0] == start


def test_the_answer_has_the_jacobian_of_its_own_place():
    """A Jacobian of secant updates is good for a step, and not for the errors of an answer."""
    t = times(500)

    def simulate(settings):
        one, two = sizes(settings, "one", "two")
        return [one * np.sin(3 * t) + (two + 0.01 * two**2) * np.sin(3.2 * t)]

    effects = candidates("one", "two")
    truth = of_size(one=1.0, two=1.5)
    hypotheses = Hypotheses(Residuals(simulate, measured(simulate(truth)[0], 0.1, 1)), effects)
    fit = hypotheses.fitted(effects, truth)
    settled = hypotheses.settled(replace(fit, jacobian=(1 + LINEARITY_ERROR) * fit.jacobian))
    two = settled.settings["two"]["size"]
    exact = -(1 + 0.02 * two) * np.sin(3.2 * t) / 0.1
    exact -= exact.mean()  # the offset of the series is free
    assert settled.rss <= fit.rss
    assert settled.jacobian[:, 1] == pytest.approx(exact, abs=1e-3 * np.abs(exact).max())
    assert hypotheses.fitted(effects, truth) is settled


def test_numbers_of_different_runs_share_a_finite_difference():
    """One evaluation for the two angles, one for the size that both runs have, and the first."""
    t, asked = np.linspace(0.0, 1.0, 50), []
    first = np.arange(100) < 50

    def residual(x):
        asked.append(x)
        size, one, two = x
        return size * np.concatenate([np.sin(7 * t + one), np.sin(7 * t + two)])

    x = np.array([0.4, 0.2, 0.7])
    jacobian = SecantJacobian(residual, (1e-6,) * 3, [None, first, ~first]).at(x)
    assert len(asked) == 3
    one, two = (0.4 * np.cos(7 * t + angle) for angle in x[1:])
    zero = np.zeros(50)
    assert jacobian[:, 1] == pytest.approx(np.concatenate([one, zero]), abs=1e-5)
    assert jacobian[:, 2] == pytest.approx(np.concatenate([zero, two]), abs=1e-5)
    assert jacobian[:, 0] == pytest.approx(residual(x) / 0.4, abs=1e-5)


def test_a_limit_of_the_deviance_is_that_of_the_noise_and_not_of_the_sum_of_squares():
    """Noise a thousand times as strong as stated hides as large a misfit."""
    residuals = problem(decaying)
    start = {"decay": {"height": 9.0, "rate": 19.0}}
    whole = least_squares_fit(residuals, [FAST], [start])
    stated = Noise.as_stated(residuals)
    strong = stated.like(1000.0 * np.random.default_rng(5).standard_normal(len(whole.residual)))
    for noise, expected in ((stated, True), (strong, False)):
        limit = Limit.of_deviance(noise.deviance(whole.residual) / 2 + 100, noise)
        assert least_squares_fit(residuals, [FAST], [start], limit).abandoned is expected


def test_a_limit_includes_closer_ones_by_the_same_noise():
    """White noise of the stated size makes the deviance a sum of squares."""
    stated = Noise.as_stated(problem(decaying))
    other = stated.like(np.ones(400))
    assert Limit.of_deviance(50.0, stated) == Limit(50.0)
    assert Limit(50.0).includes(Limit(40.0))
    assert not Limit(50.0).includes(Limit(60.0))
    assert Limit.of_deviance(50.0, other).includes(Limit.of_deviance(40.0, other))
    assert not Limit.of_deviance(50.0, other).includes(Limit(40.0))


# -- starts -------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_a_fit_begins_inside_of_its_ranges_whatever_the_start(seed):
    """A search may find a size beyond the range, or, where a model ran away, no number at all."""
    draw = np.random.default_rng(seed)
    odd = (math.nan, math.inf, -math.inf, -1e300, 1e300, 5.0)
    start = {"decay": {p.name: odd[draw.integers(len(odd))] for p in DECAY.parameters}}
    fit = least_squares_fit(problem(decaying), [DECAY], [start])
    for parameter in DECAY.parameters:
        assert parameter.low <= fit.settings["decay"][parameter.name] <= parameter.high
    assert math.isfinite(fit.rss)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("role", Role)
def test_what_is_no_number_is_the_absence_of_an_effect(value, role):
    assert Parameter("size", "V", -2.0, 3.0, role=role).within(value) == 0.0
    assert Parameter("size", "V", 1.0, 3.0, role=role).within(value) == 1.0


def test_the_jacobian_of_a_range_of_few_digits_is_finite():
    # A start known to 1e-10 beside a size of 5: a small share of that is no number beside 5.
    level = Candidate("level", (Parameter("c", "V", 5.0, 5.0 + 1e-10, (5.0,)),))
    residuals = Residuals(
        lambda settings: [np.full(9, settings.get("level", {"c": 5.0})["c"])],
        [Series("run", "probe", "V", np.full(9, 5.0), 1e-11, nuisances=np.zeros((9, 0)))],
    )
    fit = least_squares_fit(residuals, [level], [{"level": {"c": 5.0}}])
    np.testing.assert_allclose(fit.jacobian, -1 / 1e-11, rtol=0.02)
