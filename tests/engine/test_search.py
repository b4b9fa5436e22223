"""The set of effects that the search ends with, where signatures or single steps mislead it."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import mopro
from helpers.signals import candidates, diagnosed, measured, names, of_size, sizes, times
from mopro.engine import Candidate, Parameter, Role, Series
from mopro.engine.residuals import Residuals
from mopro.engine.search import screening
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.linear_subset import LinearSubsets
from mopro.engine.search.neighbours import neighbourhood, with_rivals
from mopro.engine.search.rounds import _fit_parts, search
from mopro.engine.search.screening import Screening


def test_a_single_effect_that_explains_all_is_fitted_alone_first():
    """Its response has a part that grows with the square of its size, which `straight` mimics.

    The signature of `bent` therefore predicts less than those of both together do, and yet
    `bent` comes first: it alone is predicted to leave next to nothing. From the null model the
    pair is predicted to leave less still; beside the fitted `bent` it is not, and is not fitted.
    """
    t, progress = times(500), []

    def simulate(settings):
        bent, straight = sizes(settings, "bent", "straight")
        return [bent * np.sin(7 * t) + (0.06 * bent**2 + straight) * np.cos(11 * t)]

    verdict = diagnosed(
        simulate, candidates("bent", "straight"), of_size(bent=2.5), 0.25, 2,
        progress=progress.append,
    )  # fmt: skip
    assert (verdict.verdict, names(verdict)) == ("named", {"bent"})
    fitted = [line for line in progress if line.startswith("fitting")]
    assert fitted == ["fitting bent"]


def fits_of(simulate, effects, truth, sigma):
    """The sets in the order in which they are fitted, and the names in the verdict."""
    progress = []
    verdict = diagnosed(simulate, effects, truth, sigma, 2, progress=progress.append)
    prefix = "fitting "
    return [line[len(prefix) :] for line in progress if line.startswith(prefix)], names(verdict)


def test_single_effects_that_are_predicted_as_well_are_all_fitted_first():
    """At 1 V, where it is probed, `bent` has less of the cosine than at 2.5 V, and `mimic` more."""
    t = times()

    def simulate(settings):
        bent, mimic = sizes(settings, "bent", "mimic")
        like = np.sin(7 * t) + 0.012 * np.cos(11 * t)
        return [bent * np.sin(7 * t) + 0.004 * bent**2 * np.cos(11 * t) + mimic * like]

    effects = candidates("mimic", "bent")
    fitted, named = fits_of(simulate, effects, of_size(bent=2.5), 0.01)
    assert set(fitted[:2]) == {"mimic", "bent"}
    assert named == {"bent"}


def test_what_joins_an_effect_that_signatures_misjudge_is_predicted_from_its_fit():
    """`dry` at 2.5 V has another shape than at 1 V, where it is probed: it predicts 80 %."""
    t = times()

    def simulate(settings):
        dry, other = sizes(settings, "dry", "other")
        return [dry * np.sin(7 * t) + 0.5 * dry**2 * np.cos(11 * t) + other * np.cos(13 * t)]

    truth = of_size(dry=2.5, other=0.3)
    fitted, named = fits_of(simulate, candidates("dry", "other"), truth, 0.2)
    assert fitted[:3] == ["dry", "other", "dry + other"]
    assert named == {"dry", "other"}


@pytest.mark.parametrize("seed", range(3))
def test_a_signature_is_simulated_again_at_the_size_that_it_asks_for(seed):
    """`bent` is probed at 0.1 V and 2.8 V and is there with 1 V, where its shape is another.

    At 1 V its cosine is half of its sine, which `mimic` has at any size to within 8 %.
    """
    t = times()

    def simulate(settings):
        bent, mimic = sizes(settings, "bent", "mimic")
        like = np.sin(7 * t) + 0.46 * np.cos(11 * t)
        return [bent * np.sin(7 * t) + 0.5 * bent**2 * np.cos(11 * t) + mimic * like]

    effects = [
        Candidate("bent", (Parameter("size", "V", -9.0, 9.0, (0.1, 2.8)),)),
        # Its range ends just below the size that would mimic 1 V of `bent`.
        Candidate("mimic", (Parameter("size", "V", 0.0, 0.97, (0.5,)),)),
    ]
    verdict = diagnosed(simulate, effects, of_size(bent=1.0), 0.7, seed)
    assert (verdict.verdict, names(verdict)) == ("named", {"bent"})


@pytest.mark.parametrize("seed", range(3))
def test_a_mimic_of_the_strongest_effect_does_not_keep_the_search_from_the_truth(seed):
    """Alone and with `mending`, `mimic` leaves less than `main` does without the other two.

    Of the truth (100 u + 5 w + 4 v in standard deviations) `mimic` explains 100 u + 4 w, so
    replacing one effect at a time never leads back to `main`.
    """
    t = times()
    u, v, w, y, z = (np.sin(f * t) for f in (7.0, 11.0, 17.0, 23.0, 29.0))
    effects = ("main", "second", "third", "mimic", "mending")

    def simulate(settings):
        main, second, third, mimic, mending = sizes(settings, *effects)
        mimicked = mimic * (2 - mimic) * (100 * u + 4 * w - 1.5 * z)
        mended = mending * (4 * v + 1.5 * z + 0.5 * y)
        return [100 * main * u + 5 * second * w + 4 * third * v + mimicked + mended]

    half = Parameter("size", "V", -10.0, 10.0, (0.5,))
    truth = of_size(main=1.0, second=1.0, third=1.0)
    verdict = diagnosed(simulate, candidates(*effects, size=half), truth, 1.0, seed)
    assert (verdict.verdict, names(verdict)) == ("named", set(truth))


@pytest.mark.parametrize("seed", range(3))
def test_a_wider_effect_gives_way_to_its_special_case(seed):
    """`general` is `special` where its bend is 0, and both have a rate that `special` assumes.

    At the assumed rate the signature of `special` is at a right angle to what is there.
    """
    t = times()

    def simulate(settings):
        general, special = settings.get("general", {}), settings.get("special", {})
        total = 0 * t
        for own in (general, special):
            size, rate = own.get("size", 0.0), own.get("rate", 5.0)
            total = total + size * np.sin(rate * t) + own.get("bend", 0.0) * np.cos(23 * t)
        return [total]

    size = Parameter("size", "V", -9.0, 9.0, (0.5,))
    bend = Parameter("bend", "V", -9.0, 9.0, (0.5,))
    rate = Parameter("rate", "1/s", 1.0, 20.0, (8.1,), Role.SHAPE)
    effects = [
        Candidate("special", (size,), fixed={"rate": 5.0}),
        Candidate("special", (size, replace(rate, starts=(5.0,))), "with its rate", extends=""),
        Candidate("general", (size, rate, bend), special="special"),
    ]
    truth = {"special": {"size": 2.0, "rate": 8.0}}
    verdict = diagnosed(simulate, effects, truth, 0.5, seed)
    assert (verdict.verdict, names(verdict)) == ("named", {"special"})
    assert verdict.effects[0].parameters["rate"].value == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_form_that_is_wider_makes_another_effect_superfluous(seed):
    """Beside `other` it has nothing more to explain, and ends at the end of its range."""
    t = times()
    u, v = np.sin(7 * t), np.cos(11 * t)
    idle = ("third", "fourth", "fifth")

    def simulate(settings):
        conduction, other = settings.get("conduction", {}), settings.get("other", {})
        steady = conduction.get("steady", 0.0) + other.get("size", 0.0)
        others = (size * np.sin((20 + i) * t) for i, size in enumerate(sizes(settings, *idle)))
        return [conduction.get("moving", 0.0) * u + steady * v + sum(others)]

    moving, steady, size = (
        Parameter(name, "V", 0.0, 9.0, (1.0,)) for name in ("moving", "steady", "size")
    )
    effects = [
        Candidate("conduction", (moving,), "moving", {"steady": 0.0}),
        Candidate("conduction", (moving, steady), "moving and steady", extends="moving"),
        Candidate("other", (size,)),
        *candidates(*idle),
    ]
    truth = {"conduction": {"moving": 2.0, "steady": 1.5}}
    verdict = diagnosed(simulate, effects, truth, 0.5, seed)
    assert names(verdict) == {"conduction"}
    assert verdict.effects[0].form == "moving and steady"


def test_subsets_of_known_noise_are_those_of_an_exhaustive_search():
    """The thirty best of 120 pairs and their EBIC, as they follow from least squares of each."""
    t, generator = times(), np.random.default_rng(5)
    shapes = {
        f"e{i}": generator.standard_normal(4) @ np.cos(np.outer(range(4), t)) for i in range(16)
    }

    def simulate(settings):
        return [sum((settings[n]["size"] * shapes[n] for n in settings), 0 * t)]

    (values,) = simulate(of_size(e3=0.3, e8=-0.2))
    hypotheses = Hypotheses(Residuals(simulate, measured(values, 1.0, 3)), candidates(*shapes))
    scores = Screening(hypotheses).of(hypotheses.null, hypotheses.catalogue)
    found = LinearSubsets(hypotheses.null, scores, hypotheses.white).best(2)
    pairs = [s for s in found if len(s.members) == 2]
    (series,) = hypotheses.residuals.data
    expected = []
    for one, other in combinations(shapes, 2):
        columns = np.column_stack([shapes[one], shapes[other], np.ones(len(t))])
        rss = float(np.linalg.lstsq(columns, series.values, rcond=None)[1][0])
        expected.append((rss, {one, other}))
    expected.sort(key=lambda pair: pair[0])
    assert [s.names for s in pairs] == [names for _, names in expected[: len(pairs)]]
    assert len(pairs) == 30
    assert [hypotheses.null.rss - s.reduction for s in pairs] == pytest.approx(
        [rss for rss, _ in expected[:30]]
    )


def test_two_effects_are_swapped_at_once_where_neither_swap_alone_lowers_the_ebic():
    """The errors of the two mimics (0.2 w) make up for each other; 0.15 z in one of them stays."""
    t = times()
    u, v, w, z = (np.sin(f * t) for f in (7.0, 11.0, 17.0, 23.0))
    shapes = {
        "one": 100 * u,
        "other": 10 * v,
        "like one": 100 * u + 0.2 * w,
        "like other": 10 * v - 0.2 * w + 0.15 * z,
    }

    def simulate(settings):
        return [sum((settings[name]["size"] * shapes[name] for name in settings), 0 * t)]

    (values,) = simulate(of_size(one=1.0, other=1.0))
    effects = candidates(*shapes, size=Parameter("size", "V", -10.0, 10.0, (0.5,)))
    hypotheses = Hypotheses(Residuals(simulate, measured(values, 1.0, 3)), effects)
    one, other, like_one, like_other = effects
    whole = {name: {"size": 1.0} for name in shapes}
    wrong = hypotheses.fitted([like_one, like_other], whole)
    for swapped in ([one, like_other], [like_one, other]):
        assert hypotheses.ebic(hypotheses.fitted(swapped, whole)) > hypotheses.ebic(wrong)
    nearest = neighbourhood(hypotheses, Screening(hypotheses), wrong).subsets[0]
    assert nearest.names == {"one", "other"}
    search(hypotheses, Screening(hypotheses), [wrong])
    assert hypotheses.best().names == {"one", "other"}


def test_an_effect_that_must_be_searched_for_replaces_one_that_absorbed_it():
    """A constant lateness is told from a clock that runs fast only within 1.0 to 1.2 s.

    Fitted without `delay`, the clock takes most of the lateness along, so that nothing is left
    from which a search could tell the tick: it has to look at the residual before that refit.
    """
    t = np.linspace(1.0, 1.2, 2000)
    speed, grid = np.sin(300 * t), np.sin(900 * t)

    def simulate(settings):
        fast = settings.get("clock", {}).get("e", 0.0)
        late = settings.get("delay", {}).get("d", 0.0)
        tick = settings.get("tick", {}).get("T", 0.0)
        return [(fast * t + late + tick) * speed + tick * grid / 50]

    def lateness(view):
        (residual,) = view.residuals
        yield {"T": float(residual @ speed / (speed @ speed))}

    effects = [
        Candidate("clock", (Parameter("e", "1", -900.0, 900.0, (1.0,)),)),
        Candidate("delay", (Parameter("d", "s", -900.0, 900.0, (1.0,)),)),
        Candidate("tick", (Parameter("T", "s", 0.0, 900.0, role=Role.SHAPE),),
                  find_starts=lateness),
    ]  # fmt: skip
    (values,) = simulate({"clock": {"e": 100.0}, "tick": {"T": 100.0}})
    values = values + np.random.default_rng(5).standard_normal(len(t))
    data = [Series("run", "probe", "V", values, 1.0, t, np.arange(2000) // 400)]
    hypotheses = Hypotheses(Residuals(simulate, data), effects)
    wrong = hypotheses.fitted(effects[:2], {"clock": {"e": 100.0}, "delay": {"d": 100.0}})
    assert wrong.rss > 1.5 * wrong.count
    near = neighbourhood(hypotheses, Screening(hypotheses), wrong).subsets
    beside_clock = [s for s in near if s.base.names == {"clock"}]
    swapped = [(s.candidates, s.starts) for s in beside_clock if s.names == {"clock", "tick"}]
    assert min(fit.rss for fit in hypotheses.fit_all(swapped)) < 1.1 * wrong.count


@pytest.mark.parametrize(("saved", "expected"), [(-1.0, set()), (5.4, set()), (6.6, {"line"})])
def test_an_effect_is_named_if_it_saves_an_ebic_of_2_ln_20(saved, expected):
    """The fall of chi-squared, less ln n for the parameter, is 2 ln of the Bayes factor."""
    rng = np.random.default_rng(7)
    t, sigma = np.linspace(0.0, 2.0, 400), 0.01
    shape = np.sin(5 * t) / np.linalg.norm(np.sin(5 * t))
    noise = rng.standard_normal(len(t))
    noise -= shape * (shape @ noise)
    values = sigma * (noise + shape * math.sqrt(math.log(len(t)) + saved))
    data = [Series("run", "probe", "V", values, sigma, nuisances=np.zeros((len(t), 0)))]
    line = Candidate("line", (Parameter("v", "V", -1.0, 1.0, (0.01,)),))
    verdict = mopro.reconcile(lambda s: [s.get("line", {"v": 0.0})["v"] * shape], [line], data)
    assert names(verdict) == expected
    if expected:
        (effect,) = verdict.effects
        assert 2 * math.log(10) * effect.log10_bayes_factor == pytest.approx(saved, abs=0.01)


def test_a_second_start_keeps_what_a_search_found(monkeypatch):
    """A fit that leaves more than a part of its set begins again with its effects hardly there.

    The model has a third move and no other.
    """
    t = times(200)

    def simulate(settings):
        step = settings.get("step", {"size": 0.0, "move": 3.0})
        return [step["size"] * {3.0: t > 2.0}[step["move"]]]

    size, move = Parameter("size", "V", -9.0, 9.0), Parameter("move", "1", 0, 9, role=Role.SEARCHED)
    step = Candidate("step", (size, move), find_starts=lambda _: [{"size": 1.0, "move": 3.0}])
    hypotheses = Hypotheses(Residuals(simulate, measured(2.0 * (t > 2.0), 0.1, 1)), [step])
    monkeypatch.setattr("mopro.engine.search.hypotheses._lower_subset", lambda *_: hypotheses.null)
    fit = hypotheses.fitted([step], {"step": {"size": 1.0, "move": 3.0}})
    assert fit.settings["step"]["size"] == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("jobs", [1, 3])
def test_neither_the_order_of_proposals_nor_the_number_of_jobs_matters(jobs):
    """`stuck` is constant on either side of 0.5 V, so that its fit stays where it begins."""
    t = times(300)

    def simulate(settings):
        straight, stuck = sizes(settings, "straight", "stuck")
        return [straight * np.sin(7 * t) + (5 * np.cos(11 * t) if stuck > 0.5 else 0 * t)]

    straight, stuck = candidates("straight", "stuck")
    data = measured(2 * np.sin(7 * t), 0.1, 1)
    proposals = [
        ([straight], [of_size(straight=1.0)]),
        ([straight, stuck], [of_size(straight=1.0, stuck=1.0)]),
    ]
    left = {}
    for order in (1, -1):
        hypotheses = Hypotheses(Residuals(simulate, data), [straight, stuck], jobs=jobs)
        left[order] = {fit.names: fit.rss for fit in hypotheses.fit_all(proposals[::order])}
    assert left[1] == left[-1]
    assert left[1][frozenset({"straight"})] < 400


@pytest.mark.parametrize(("amplitude", "replaced"), [(1.0, [{"spring", "tick"}]), (1e-3, [])])
def test_the_strongest_effect_is_replaced_by_one_that_does_as_well_by_itself(amplitude, replaced):
    """Only where the null model is far from linear; elsewhere the signatures predict it.

    `tick` is a delay that wanders. It begins at the size that it has alone, and the other
    effect of the set stays as it is; `spring`, which explains little, is not replaced.
    """
    t = times()

    def simulate(settings):
        delay, tick, spring = sizes(settings, "delay", "tick", "spring")
        late = delay + tick * (1 + 0.02 * np.cos(3 * t))
        return [amplitude * (np.sin(20 * t - 3 * late) + 0.05 * spring * np.sin(2 * t))]

    series = measured(simulate(of_size(tick=0.4, spring=1.0))[0], 1e-3, 1)
    catalogue = {c.name: c for c in candidates("delay", "tick", "spring")}
    hypotheses = Hypotheses(Residuals(simulate, series), list(catalogue.values()))
    for name in catalogue:
        hypotheses.fitted([catalogue[name]], of_size(**{name: 0.3}))
    pair = [catalogue["delay"], catalogue["spring"]]
    fit = hypotheses.fitted(pair, of_size(delay=0.4, spring=0.9))
    proposals = with_rivals(hypotheses, fit)
    assert [{c.name for c in own} for own, _ in proposals] == replaced
    for own, (start,) in proposals:
        assert start["tick"]["size"] == pytest.approx(0.4, abs=0.01)
        assert start["spring"] == fit.settings["spring"]
        assert len(own) == 2


def test_a_superset_is_predicted_from_the_nearest_base_alone():
    """A set of two effects is a neighbour of their sum, and of the null model no more."""
    t = times(500)

    def simulate(settings):
        one, two, three = sizes(settings, "one", "two", "three")
        return [one * np.sin(3 * t) + two * np.sin(7 * t) + three * np.sin(11 * t)]

    effects = candidates("one", "two", "three")
    truth = of_size(one=1.0, two=1.0)
    hypotheses = Hypotheses(Residuals(simulate, measured(simulate(truth)[0], 0.1, 1)), effects)
    fit = hypotheses.fitted(effects[:2], truth)
    near = neighbourhood(hypotheses, Screening(hypotheses), fit).subsets
    bases = {}
    for subset in near:
        bases.setdefault(subset.names, []).append(subset.base.names)
    assert bases[frozenset({"one", "two", "three"})] == [{"one", "two"}]
    assert bases[frozenset({"one", "three"})] == [{"one"}]
    assert bases[frozenset({"two", "three"})] == [{"two"}]


def test_an_effect_in_its_plain_form_does_not_lose_to_one_with_more_numbers():
    """`late` wanders by 0.4 of itself, and its plain form takes 0.2 for granted.

    The four sizes of `sum` describe it a little better than that, and worse than the form of
    `late` in which the wandering is fitted; its signature predicts little, as it is 2 rad.
    """
    t = times()
    wander = np.sin(2 * t)

    def simulate(settings):
        late = settings.get("late", {"size": 0.0, "delta": 0.0})
        own = settings.get("sum", dict.fromkeys("abcd", 0.0))
        turn = late["size"] * (1 + late["delta"] * wander)
        cosine, sine = np.cos(7 * t), np.sin(7 * t)
        linear = own["a"] * cosine + own["b"] * sine
        return [np.sin(7 * t + turn) + linear + wander * (own["c"] * cosine + own["d"] * sine)]

    size = Parameter("size", "rad", -3.0, 3.0, (0.3,))
    delta = Parameter("delta", "1", 0.0, 1.0, (0.2,), Role.SHAPE)
    plain = Candidate("late", (size,), fixed={"delta": 0.2})
    wide = Candidate("late", (size, delta), form="wander fitted", extends="")
    linear = tuple(Parameter(name, "V", -3.0, 3.0, (1.0,)) for name in "abcd")
    effects = [Candidate("sum", linear), plain, wide]
    truth = {"late": {"size": 2.0, "delta": 0.4}}
    verdict = diagnosed(simulate, effects, truth, 0.1, seed=1)
    assert (verdict.verdict, names(verdict)) == ("named", {"late"})
    assert verdict.effects[0].parameters["delta"].value == pytest.approx(0.4, abs=0.02)


def test_the_noise_is_what_the_set_in_another_form_leaves():
    """`late` in its plain form leaves a wave of 0.6 V beside one that nobody listed, of 0.8 V."""
    t = times()

    def simulate(settings):
        late = settings.get("late", {"size": 0.0, "share": 0.0})
        return [late["size"] * (np.sin(7 * t) + late["share"] * np.sin(11 * t))]

    size = Parameter("size", "V", -9.0, 9.0, (1.0,))
    share = Parameter("share", "1", 0.0, 1.0, (0.2,), Role.SHAPE)
    plain = Candidate("late", (size,), fixed={"share": 0.2})
    wide = Candidate("late", (size, share), form="share fitted", extends="")
    truth = {"late": {"size": 3.0, "share": 0.4}}
    data = measured(simulate(truth)[0] + 0.8 * np.sin(17 * t), 0.1, 1)
    hypotheses = Hypotheses(Residuals(simulate, data), [plain, wide])
    search(hypotheses, Screening(hypotheses), rounds=0)
    fullest = hypotheses.fullest()
    assert fullest.candidates == (wide,)
    judged = hypotheses.ebic(fullest)
    hypotheses.judge_by(fullest)
    assert hypotheses.ebic(fullest) == judged


def test_a_size_beyond_which_an_effect_saturates_is_left_again():
    """The signature at 3 V asks for 1.5 V, and beyond 1 V nothing depends on the size."""
    t = times()

    def simulate(settings):
        (play,) = sizes(settings, "play")
        return [min(play, 1.0) * np.sin(7 * t)]

    effects = [Candidate("play", (Parameter("size", "V", 0.0, 10.0, (3.0,)),))]
    verdict = diagnosed(simulate, effects, of_size(play=0.5), 0.1, seed=1)
    assert (verdict.verdict, names(verdict)) == ("named", {"play"})
    assert verdict.effects[0].parameters["size"].value == pytest.approx(0.5, abs=0.02)


def test_what_may_join_a_set_is_simulated_once():
    """Also at the size that a signature asks for: `bent` is probed at 0.1 V and is there with 2."""
    t, asked = times(), []

    def simulate(settings):
        asked.append(settings)
        (bent,) = sizes(settings, "bent")
        return [bent * np.sin(7 * t) + 0.01 * bent**2 * np.cos(11 * t)]

    effects = [Candidate("bent", (Parameter("size", "V", -9.0, 9.0, (0.1,)),))]
    series = measured(simulate(of_size(bent=2.0))[0], 0.7, 1)
    hypotheses = Hypotheses(Residuals(simulate, series), effects)
    screening = Screening(hypotheses)
    (first,) = screening.beside(hypotheses.null, hypotheses.null)
    assert first.group[0].values["size"] > 1.0
    asked.clear()
    assert screening.beside(hypotheses.null, hypotheses.null) == [first]
    assert not asked


def test_what_may_join_a_set_as_good_as_the_best_is_looked_for_beside_the_best():
    """`second` is `first` within 10 in chi-squared, and 2 % of what it explains is 2000."""
    t, absent, said = times(), [f"absent {f}" for f in range(30, 38)], []

    def simulate(settings):
        first, second, *others = sizes(settings, "first", "second", *absent)
        lines = (c * np.sin(f * t) for f, c in enumerate(others, start=30))
        slightly_other = second * (np.sin(7 * t) + 5e-3 * np.cos(3 * t))
        return [first * np.sin(7 * t) + slightly_other + sum(lines)]

    data = measured(simulate(of_size(first=1.0))[0], 0.1, seed=1)
    effects = candidates("first", "second", *absent)
    hypotheses = Hypotheses(Residuals(simulate, data), effects, progress=said.append)
    search(hypotheses, Screening(hypotheses))
    assert hypotheses.best().names == {"first"}
    assert "fitting second" in said
    assert not [line for line in said if line.startswith("fitting") and "absent" in line]


def test_what_shows_only_beside_another_effect_is_seen_there():
    """At the null model, which is near linear, `slip` has no signature, as there is no grip."""
    t, absent = times(4000), [f"absent {f}" for f in range(30, 40)]

    def simulate(settings):
        grip, slip, *others = sizes(settings, "grip", "slip", *absent)
        lines = (c * np.sin(f * t) for f, c in enumerate(others, start=30))
        return [grip * np.sin(7 * t) + slip * np.tanh(grip) * np.sin(23 * t) + sum(lines)]

    data = measured(simulate(of_size(grip=1.0, slip=0.3))[0], 0.2, 1)
    effects = candidates("grip", "slip", *absent)
    hypotheses = Hypotheses(Residuals(simulate, data), effects)
    grip = hypotheses.fitted(effects[:1], of_size(grip=1.0))
    scores = {s.candidate.name: s for s in Screening(hypotheses).beside(grip, grip)}
    expected = 4000 / 2 * (0.3 * np.tanh(1.0) / 0.2) ** 2
    assert scores["slip"].predicted_reduction == pytest.approx(expected, rel=0.1)


def test_what_made_up_for_another_effect_goes_when_that_is_replaced():
    """`bent` has a shape that its signature takes for 0, and `straight` is like it there.

    `bent` is first fitted in place of `straight`, beside `rest`, which it then needs no more.
    """
    t, absent = times(1000), [f"absent {f}" for f in range(30, 38)]

    def simulate(settings):
        straight, rest, *others = sizes(settings, "straight", "rest", *absent)
        bent = settings.get("bent", {"size": 0.0, "shape": 0.0})
        one = straight + bent["size"]
        other = rest + bent["size"] * bent["shape"]
        lines = (c * np.sin(f * t) for f, c in enumerate(others, start=30))
        return [one * np.sin(7 * t) + other * np.sin(11 * t) + sum(lines)]

    size = Parameter("size", "V", -9.0, 9.0, (1.0,))
    shape = Parameter("shape", "1", -5.0, 5.0, (0.0,), Role.SHAPE)
    effects = [*candidates("straight", "rest", *absent), Candidate("bent", (size, shape))]
    truth = {"bent": {"size": 1.0, "shape": 1.5}}
    hypotheses = Hypotheses(Residuals(simulate, measured(simulate(truth)[0], 0.3, 1)), effects)
    search(hypotheses, Screening(hypotheses))
    assert hypotheses.best().names == {"bent"}


@pytest.mark.parametrize(
    ("b", "c", "known", "found"),
    [
        (1.0, 0.5, True, {"a", "b", "c"}),
        (0.5, 1.0, True, {"a", "b"}),
        (1.0, 0.5, False, {"a", "b"}),
    ],
)
def test_a_search_goes_on_while_its_best_set_leaves_less_than_half(b, c, known, found):
    """`b` shows only beside `a`, and `c` only beside `b`, so that each takes a round of its own.

    Of what `a` leaves, `b` takes the share 1 / (1 + c²). The rest may be noise where its
    size is unknown.
    """
    t = times()

    def simulate(settings):
        a, b, c = sizes(settings, "a", "b", "c")
        return [a * (np.sin(7 * t) + b * (np.sin(11 * t) + c * np.sin(17 * t)))]

    (series,) = measured(simulate(of_size(a=3.0, b=b, c=c))[0], 0.05, 1)
    data = [series if known else replace(series, sigma=None)]
    hypotheses = Hypotheses(Residuals(simulate, data), candidates("a", "b", "c"))
    search(hypotheses, Screening(hypotheses), rounds=1)
    assert hypotheses.best().names == found


@pytest.mark.parametrize("kept", [1, 100_000])
def test_how_many_signatures_are_kept_decides_nothing(monkeypatch, kept):
    t = times()

    def simulate(settings):
        first, second, third = sizes(settings, *"abc")
        return [first * np.sin(7 * t) + second * np.cos(11 * t) + third * np.sin(11 * t + 0.1)]

    def asked():
        return diagnosed(simulate, candidates(*"abc"), of_size(a=1.0, b=0.5), 0.2, 2).as_json()

    before = asked()
    monkeypatch.setattr(screening, "_KEPT_BYTES", kept)
    assert asked() == before


def test_what_replaces_an_effect_is_predicted_beside_the_others_as_they_are():
    """Fitted without `slow`, `play` takes its sine along and is off by 0.77 V.

    There its response is another; beside `play` at 1 V, `late` is predicted to leave noise.
    """
    t = times()

    def simulate(settings):
        play, late, slow = sizes(settings, "play", "late", "slow")
        bent = play * np.sin(7 * t) + 0.3 * play**2 * np.cos(11 * t)
        return [bent + (late + slow) * np.sin(7 * t + 0.3) + 0.02 * slow * np.sin(13 * t)]

    data = measured(simulate(of_size(play=1.0, late=1.5))[0], 0.01, 1)
    hypotheses = Hypotheses(Residuals(simulate, data), candidates("play", "late", "slow"))
    play, _, slow = hypotheses.catalogue
    fit = hypotheses.fitted([play, slow], of_size(play=1.0, slow=1.5))
    assert hypotheses.without(fit, "slow").settings["play"]["size"] == pytest.approx(1.77, abs=0.01)
    near = neighbourhood(hypotheses, Screening(hypotheses), fit).subsets
    (swapped,) = [s for s in near if s.names == {"play", "late"}]
    found = hypotheses.fitted(swapped.candidates, swapped.start)
    assert swapped.base.rss - swapped.reduction == pytest.approx(found.rss, rel=1e-3)
    assert found.rss < 1.1 * found.count


def test_an_effect_that_gains_less_than_signatures_err_is_not_fitted_with_the_others():
    """The part of `one` that grows with its square looks like `straight` from the null model.

    Beside both fitted, nothing is left for it.
    """
    t = times()

    def simulate(settings):
        one, other, straight = sizes(settings, "one", "other", "straight")
        bent = one * np.sin(7 * t) + 0.03 * one**2 * np.cos(11 * t)
        return [bent + other * np.sin(17 * t) + straight * np.cos(11 * t)]

    truth = of_size(one=2.5, other=2.0)
    fitted, named = fits_of(simulate, candidates("one", "other", "straight"), truth, 0.05)
    assert "one + other" in fitted
    assert "one + other + straight" not in fitted
    assert named == {"one", "other"}


def test_sets_are_given_up_where_one_before_them_leaves_noise():
    """Beside `main`, `next` leaves noise; its mimics have 0.8 of it and leave much more than that.

    What `main` leaves by itself, as a noise with memory, would let all of them do as well.
    """
    t, mimics = times(), [f"mimic {f}" for f in (17, 19, 23, 29)]

    def simulate(settings):
        main, following, *others = sizes(settings, "main", "next", *mimics)
        total = main * np.sin(7 * t) + following * np.tanh(main) * np.sin(3 * t)
        for size, name in zip(others, mimics, strict=True):
            like = 0.8 * np.sin(3 * t) + 0.6 * np.sin(int(name[-2:]) * t)
            total = total + size * np.tanh(main) * like
        return [total]

    data = measured(simulate({**of_size(main=9.0), **of_size(next=0.5)})[0], 0.01, 1)
    hypotheses = Hypotheses(Residuals(simulate, data), candidates("main", "next", *mimics))
    search(hypotheses, Screening(hypotheses))
    assert hypotheses.best().names == {"main", "next"}
    finished = [
        f.names for f in hypotheses.ranked() if f.names > {"main"} and "next" not in f.names
    ]
    assert len(finished) <= 1


def test_an_effect_that_ends_at_zero_is_left_out_before_the_next_round():
    """The data ask for a `rest` below 0, which is the end of its range."""
    t = times(1000)

    def simulate(settings):
        main, rest = sizes(settings, "main", "rest")
        return [main * np.sin(7 * t) + rest * np.sin(11 * t)]

    data = measured(simulate(of_size(main=1.0, rest=-0.02))[0], 0.3, 1)
    size = Parameter("size", "V", 0.0, 9.0, (1.0,))
    hypotheses = Hypotheses(Residuals(simulate, data), candidates("main", "rest", size=size))
    fit = hypotheses.fitted(hypotheses.catalogue, of_size(main=1.0, rest=0.5))
    assert fit.settings["rest"]["size"] == 0.0
    _fit_parts(hypotheses, fit)
    assert hypotheses.best().names == {"main"}


def test_of_sets_that_leave_the_same_noise_one_is_expanded():
    """`second` is in the catalogue before `first`, and leaves the same to within 1."""
    t, expanded = times(), []

    def simulate(settings):
        second, first, other = sizes(settings, "second", "first", "other")
        slightly = 1e-4 * np.cos(3 * t)
        return [(first + second) * np.sin(7 * t) + second * slightly + other * np.sin(11 * t)]

    data = measured(simulate(of_size(first=1.0))[0], 0.1, seed=1)
    hypotheses = Hypotheses(Residuals(simulate, data), candidates("second", "first", "other"))
    screening = Screening(hypotheses)
    _, first, _ = hypotheses.catalogue
    known = hypotheses.fitted([first], of_size(first=1.0))
    hypotheses.judge_by(known)
    before = screening.subsets

    def subsets(base, at, most):
        expanded.append(at.names)
        return before(base, at, most)

    screening.subsets = subsets
    search(hypotheses, screening, [known])
    assert hypotheses.best().names == {"second"}
    assert set(expanded) == {frozenset(), frozenset({"first"})}


@pytest.mark.parametrize("found", [math.nan, math.inf, -math.inf, 1e300, -50.0])
def test_what_a_search_finds_beyond_all_bounds_ends_nothing(found):
    """A model that ran away leaves a search nothing that is a number."""
    t = times(500)

    def simulate(settings):
        there, wild = sizes(settings, "there", "wild")
        return [there * np.sin(7 * t) + wild * np.cos(11 * t)]

    there, wild = candidates("there", "wild")
    wild = replace(wild, find_starts=lambda view: iter([{"size": found}]))
    verdict = diagnosed(simulate, [there, wild], of_size(there=1.0), 0.1, 3)
    assert (verdict.verdict, names(verdict)) == ("named", {"there"})
