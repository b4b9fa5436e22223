"""Free numbers of the model itself, and what the verdict says of runs that were not fitted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

import mopro
from helpers.signals import candidates, diagnosed, measured, names, of_size, sizes, times
from mopro.engine import Candidate, Parameter, Series
from mopro.engine.passes.given import fit_given
from mopro.engine.residuals import Residuals
from mopro.engine.search.hypotheses import Hypotheses

T = times(1000)
BASE = (Parameter("k", "V", 0.0, 10.0, (1.0,)), Parameter("r", "1/s", 0.0, 2.0, (0.1,)))
TRUTH = {"base": {"k": 4.0, "r": 0.3}}
SIGMA = 0.2


def decaying(settings):
    own = settings["base"]
    (line,) = sizes(settings, "line")
    return [own["k"] * np.cos(3 * T) * np.exp(-own["r"] * T) + line * np.sin(7 * T)]


def verdict_on(truth, seed=0):
    effects = candidates("line", "other")
    return diagnosed(decaying, effects, TRUTH | truth, SIGMA, seed, base=BASE)


@pytest.mark.parametrize(("line", "verdict"), [(0.0, "none"), (0.5, "named")])
def test_the_numbers_of_the_model_are_fitted_and_are_no_effects(line, verdict):
    truth = of_size(line=line) if line else {}
    answer = verdict_on(truth)
    assert (answer.verdict, names(answer)) == (verdict, set(truth))
    assert answer.base.keys() == {"k", "r"}
    assert answer.base["k"].value == pytest.approx(4.0, abs=0.1)
    assert (answer.base["k"].unit, answer.base["r"].unit) == ("V", "1/s")
    assert answer.settings["base"] == {n: e.value for n, e in answer.base.items()}


def test_their_intervals_cover_the_truth_about_as_often_as_they_say():
    hits = []
    for seed in range(12):
        answer = verdict_on(of_size(line=0.5), seed)
        for name, estimate in answer.base.items():
            low, high = estimate.ci95
            assert high - low < 0.2 * TRUTH["base"][name]
            hits.append(low <= TRUTH["base"][name] <= high)
    assert len(hits) == 24
    assert sum(hits) >= 20


def test_the_model_without_effects_has_numbers_of_its_own():
    """Those make up for a part of the line: `before` is the best that the bare model does."""
    answer = verdict_on(of_size(line=0.5))
    (series,) = run(of_size(line=0.5))

    def left(numbers):
        (values,) = decaying({"base": dict(zip(answer.base, numbers, strict=True))})
        residual = series.values - values
        return residual - residual.mean()

    bare = optimize.least_squares(left, [1.0, 1.0]).x
    assert list(answer.base_before["base"].values()) == pytest.approx(bare.tolist(), rel=1e-3)
    assert answer.base_before["base"]["k"] > 1.03 * answer.base["k"].value
    # Where nobody listed the line, they are told as they are beside the term that describes it.
    drafted = mopro.reconcile(decaying, [], [series], base=BASE)
    assert [draft.of for draft in drafted.drafts] == ["t"]
    assert drafted.base["k"].value == pytest.approx(4.0, abs=0.1)
    assert drafted.base_before == answer.base_before


def run(truth, offset=0.0, seed=0):
    (values,) = decaying(TRUTH | truth)
    return measured(values + offset, SIGMA, seed)


def test_a_run_that_was_not_fitted_is_predicted_with_an_offset_of_its_own():
    answer = verdict_on(of_size(line=0.5))
    (gap,) = answer.predict(decaying, run(of_size(line=0.5), offset=9.0, seed=7))
    assert gap.after_rms == pytest.approx(SIGMA, rel=0.1)
    assert gap.before_rms > 1.7 * gap.after_rms
    assert (gap.run, gap.sensor, gap.unit, gap.noise_rms) == ("run", "probe", "V", SIGMA)
    (other,) = answer.predict(decaying, run({}, seed=7))
    assert other.after_rms > 1.5 * other.before_rms


def test_the_sizes_of_the_nuisances_are_told_in_the_unit_of_the_series():
    shapes = np.column_stack([np.ones(len(T)), np.cos(11 * T)])
    (values,) = decaying(TRUTH | of_size(line=0.5))
    noise = SIGMA * np.random.default_rng(3).standard_normal(len(T))
    series = Series(
        "run", "probe", "V", values + shapes @ [0.7, -1.5] + noise, SIGMA, T, nuisances=shapes
    )
    answer = mopro.reconcile(decaying, candidates("line"), [series], base=BASE)
    assert names(answer) == {"line"}
    (found,) = answer.nuisances
    assert found == pytest.approx([0.7, -1.5], abs=5 * SIGMA / np.sqrt(len(T) / 2))


def test_correlations_are_those_of_the_normal_matrix():
    """Two lines that share a half of their squares: their sizes correlate by -0.5."""
    one, other = np.sin(8 * np.pi * T / 5), np.sin(14 * np.pi * T / 5)
    shapes = {"one": one, "both": 0.5 * one + np.sqrt(0.75) * other}

    def simulate(settings):
        return [sum((v["size"] * shapes[n] for n, v in settings.items()), 0 * T)]

    truth = of_size(one=1.0, both=1.0)
    answer = diagnosed(simulate, candidates(*shapes), truth, SIGMA, 2)
    assert names(answer) == set(truth)
    assert answer.correlations["one.size"]["both.size"] == pytest.approx(-0.5, abs=0.02)
    assert answer.correlations["both.size"]["one.size"] == pytest.approx(-0.5, abs=0.02)
    assert answer.correlations["one.size"]["one.size"] == 1.0


def test_numbers_of_which_only_the_product_is_told_leave_the_others_their_intervals():
    """`k` is a product of two numbers: `r` is known as well as beside one."""
    one, other = (replace(BASE[0], name=name, starts=(2.0,)) for name in ("one", "other"))

    def product(settings):
        own = settings["base"]
        k = own["one"] * own["other"]
        return decaying({**settings, "base": {"k": k, "r": own["r"]}})

    base = (one, other, BASE[1])
    answer = mopro.reconcile(product, candidates("line"), run({}), base=base)
    low, high = answer.base["r"].ci95
    assert (low, high) == pytest.approx(verdict_on({}).base["r"].ci95, rel=1e-3)
    assert answer.base["one"].ci95 == (-np.inf, np.inf)
    assert answer.correlations == {"base.r": {"base.r": 1.0}}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_numbers_of_which_only_quotients_are_told_have_wide_intervals(seed):
    """A mass on a spring that swings freely: k / m and c / m count, and the start is known.

    The response is not linear in the numbers, and differences to one side seem to tell them apart.
    """
    numbers = (
        Parameter("k", "N/m", 1.0, 100.0, (20.0,)),
        Parameter("c", "N s/m", 0.0, 5.0, (0.3,)),
        Parameter("m", "kg", 0.5, 10.0, (2.0,)),
        Parameter("x", "m", 0.0, 5.0, (1.0,)),
    )

    def swinging(settings):
        own = settings["base"]
        decay, stiffness = own["c"] / own["m"] / 2, own["k"] / own["m"]
        return [own["x"] * np.exp(-decay * T) * np.cos(np.sqrt(stiffness - decay**2) * T)]

    truth = {"k": 18.0, "c": 0.4, "m": 2.0}
    (values,) = swinging({"base": {**truth, "x": 1.0}})
    answer = mopro.reconcile(swinging, [], measured(values, 1e-3, seed), base=numbers)
    assert answer.verdict == "none"
    for name, true in truth.items():
        low, high = answer.base[name].ci95
        assert low < true < high
        assert high - low > true
    low, high = answer.base["x"].ci95
    assert low < 1.0 < high < low + 1e-3
    assert answer.base["k"].value / answer.base["m"].value == pytest.approx(9.0, abs=0.01)


def test_unknown_noise_is_taken_from_what_the_fitted_numbers_leave():
    """The model is a measured reference times `k`, which starts at a quarter of the truth."""
    rng = np.random.default_rng(4)
    reference = rng.standard_normal(len(T))
    series = Series("run", "probe", "V", 4 * reference + SIGMA * rng.standard_normal(len(T)), None)
    start = {"base": {"k": 1.0}}
    residuals = Residuals(lambda s: [s["base"]["k"] * reference], [series], scaled_at=start)
    assert residuals.sigmas == pytest.approx([3.0], rel=0.1)
    hypotheses = Hypotheses(residuals, (), (Candidate("base", BASE[:1]),))
    assert hypotheses.residuals.sigmas == pytest.approx([SIGMA], rel=0.1)
    assert hypotheses.null.settings["base"]["k"] == pytest.approx(4.0, abs=0.03)


def test_base_is_no_name_of_an_effect():
    with pytest.raises(ValueError, match='"base" is the name of the free numbers of the model'):
        mopro.reconcile(decaying, candidates("base"), run({}), base=BASE)


def swinging(settings):
    own, (decay,) = settings["base"], sizes(settings, "decay")
    return [np.exp(-decay * T) * np.cos(own["w"] * T + own["p"])]


def test_a_free_swing_is_fitted_from_its_beginning_on():
    """A third off in frequency is eleven cycles at the end: fitted as a whole it is lost."""
    base = (Parameter("w", "1/s", 10.0, 100.0, (30.0,)), Parameter("p", "rad", -1.0, 1.0, (0.0,)))
    truth = {"base": {"w": 44.0, "p": 0.3}, "decay": {"size": 0.2}}
    effect = Candidate("decay", (Parameter("size", "1/s", 0.0, 2.0, (0.1,)),))
    answer = diagnosed(swinging, [effect], truth, 0.01, seed=0, base=base)
    assert (answer.verdict, names(answer)) == ("named", {"decay"})
    assert answer.base["w"].value == pytest.approx(44.0, abs=0.01)
    assert answer.effects[0].parameters["size"].value == pytest.approx(0.2, abs=0.01)


def test_a_start_state_that_one_part_alone_knows_is_not_refitted_without_that_part():
    """The start is lost after the first of five seconds; the pull shows in all of them."""

    def model(settings):
        own, (pull,) = settings["base"], sizes(settings, "pull")
        return [own["x0"] * np.exp(-8 * T) + pull * np.sin(5 * T)]

    base = (Parameter("x0", "V", -50.0, 50.0, (1.0,)),)
    truth = {"base": {"x0": 10.0}} | of_size(pull=0.3)
    answer = diagnosed(model, candidates("pull"), truth, 0.1, seed=4, base=base)
    assert (answer.verdict, names(answer)) == ("named", {"pull"})
    assert answer.gap.held_out_rms == pytest.approx(0.1, rel=0.1)


def test_a_run_of_unknown_noise_is_predicted_by_a_model_that_asks_for_its_numbers():
    """The noise of such a run is told by the model with its numbers as they were fitted."""

    def strict(settings):
        others = {name: values for name, values in settings.items() if name != "base"}
        return decaying({"base": dict(settings["base"])} | others)

    unknown = [replace(series, sigma=None) for series in run(of_size(line=0.5))]
    answer = mopro.reconcile(strict, candidates("line"), unknown, base=BASE)
    (gap,) = answer.predict(strict, unknown)
    assert gap.after_rms == pytest.approx(SIGMA, rel=0.1)
    # What nobody listed is more than noise, and the model is asked again in finer steps.
    unlisted = mopro.reconcile(strict, candidates("other"), unknown, base=BASE, finer=strict)
    assert unlisted.verdict == "unexplained"


def test_the_model_alone_is_where_its_last_fit_ended():
    data = run(of_size(line=0.5))
    residuals = Residuals(decaying, data, scaled_at=TRUTH)
    hypotheses = Hypotheses(residuals, [], [Candidate("base", BASE)])
    settled = hypotheses.settled(hypotheses.null)
    assert hypotheses.null is settled is hypotheses.best()


def test_effects_that_are_given_are_fitted_beside_the_numbers_of_the_model():
    """Also one that is not there, whatever the evidence: its interval holds 0."""
    start = of_size(line=0.2, other=0.2)

    def both(settings):
        (other,) = sizes(settings, "other")
        return [decaying(settings)[0] + other * np.sin(5 * T)]

    answer = mopro.reconcile(
        both, candidates("line", "other"), run(of_size(line=0.5)), base=BASE,
        passes=[fit_given(start)],
    )  # fmt: skip
    found = {effect.name: effect.parameters["size"] for effect in answer.effects}
    assert found["line"].value == pytest.approx(0.5, abs=0.05)
    low, high = found["other"].ci95
    assert -0.1 < low < 0 < high < 0.1
    assert answer.base["k"].value == pytest.approx(4.0, abs=0.1)
