"""Families: the effects that the data cannot tell from the one that is named."""

from types import SimpleNamespace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import (
    candidates,
    diagnosed,
    family,
    measured,
    names,
    of_size,
    sizes,
    times,
)
from mopro.engine import Candidate, Parameter, Role, Series
from mopro.engine.fits import Limit
from mopro.engine.residuals import Residuals
from mopro.engine.search.alternatives import _exchanged, _is_needed, alternatives
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.screening import Screening


def test_two_effects_of_the_same_response_are_a_family():
    servo = Servo()
    twin = Candidate("twin_of_viscous", (Parameter("c", "N s/m", 0, 20, (1.0,)),))

    def simulate(settings):
        others = {name: values for name, values in settings.items() if name != twin.name}
        if twin.name in settings:
            others["viscous"] = {"b": settings[twin.name]["c"]}
        return servo.predict(others)

    data = servo.measure({"viscous": {"b": 3.0}}, 0.1, 0)
    verdict = mopro.reconcile(simulate, (*CATALOGUE, twin), data)
    (effect,) = verdict.effects
    assert verdict.verdict == "ambiguous"
    assert family(effect) == {"viscous", "twin_of_viscous"}


@pytest.mark.parametrize("seed", range(3))
def test_an_alternative_whose_signature_is_slightly_wrong_is_in_the_family(seed):
    """Probed at 1 V, `bent` has 0.14 V of another shape, which is 2 % of its sum of squares.

    At 0.4 V, which would explain the data, it has 0.009 V, and the noise of 0.18 V hides that.
    """
    t = times()

    def simulate(settings):
        straight, bent = sizes(settings, "straight", "bent")
        return [(straight + bent) * np.sin(7 * t) + 0.14 * bent**3 * np.cos(11 * t)]

    effects = candidates("straight", "bent")
    (effect,) = diagnosed(simulate, effects, of_size(straight=0.4), 0.18, seed).effects
    assert family(effect) == {"straight", "bent"}


def test_a_family_of_many_is_fitted_whole():
    """Each of fourteen has another 2 % of its response: all alike to signatures and to noise.

    At 40 σ they are fitted to tell, more of them than the kinds that are fitted in a round.
    """
    t = times(2000)
    members = [f"member{i}" for i in range(14)]

    def simulate(settings):
        own = zip(sizes(settings, *members), range(14), strict=True)
        return [sum(a * (np.sin(7 * t) + 0.02 * np.cos((11 + i) * t)) for a, i in own)]

    effects = candidates(*members)
    verdict = diagnosed(simulate, effects, of_size(member4=0.4), 0.4 * np.sqrt(1000) / 40, 3)
    (effect,) = verdict.effects
    assert family(effect) == set(members)


@pytest.mark.parametrize("seed", range(3))
def test_a_weak_alternative_that_differs_at_its_own_size_is_not_in_the_family(seed):
    """At 1 V, where it is probed, `bent` is the same; at 0.4 V it has -0.19 V of another shape.

    That is 7.6 standard deviations of the noise over 2000 samples.
    """
    t = times()

    def simulate(settings):
        straight, bent = sizes(settings, "straight", "bent")
        return [(straight + bent) * np.sin(7 * t) + 0.8 * bent * (bent - 1) * np.cos(11 * t)]

    effects = candidates("straight", "bent")
    (effect,) = diagnosed(simulate, effects, of_size(straight=0.4), 0.8, seed).effects
    assert (effect.name, effect.indistinguishable_from) == ("straight", [])
    assert effect.sigmas < 20


def test_a_shared_effect_at_the_end_of_its_range_keeps_no_family_away():
    """`stopped` is there with 2 V, and may have 1.9 V."""
    t = times()

    def simulate(settings):
        stopped, one, twin = sizes(settings, "stopped", "one", "twin")
        return [stopped * np.sin(7 * t) + (one + twin) * np.cos(11 * t)]

    effects = candidates("one", "twin")
    effects += candidates("stopped", size=Parameter("size", "V", -1.9, 1.9, (1.0,)))
    verdict = diagnosed(simulate, effects, of_size(stopped=2.0, one=1.0), 1.0, 2)
    assert names(verdict) == {"stopped", "one"}
    (effect,) = [e for e in verdict.effects if e.name == "one"]
    assert family(effect) == {"one", "twin"}


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_a_family_does_not_depend_on_the_unit_where_the_noise_is_unknown(scale):
    """The shapes differ by 0.3 cos(11 t): 4 in chi-squared at this size of them."""
    t = np.linspace(0.0, 1.0, 500)
    shapes = {"one": np.sin(7 * t), "other": np.sin(7 * t) + 0.3 * np.cos(11 * t)}
    noise = np.random.default_rng(4).standard_normal(len(t))

    def simulate(settings):
        return [sum((v["size"] * shapes[n] for n, v in settings.items()), np.zeros(len(t)))]

    effects = candidates(*shapes, size=Parameter("size", "N", -50 * scale, 50 * scale, (scale,)))
    data = [Series("run", "force", "N", scale * (0.5 * shapes["one"] + noise), None, t)]
    (effect,) = mopro.reconcile(simulate, effects, data).effects
    assert family(effect) == set(shapes)


def test_neither_a_part_of_the_answer_nor_a_set_that_contains_it_is_an_alternative():
    """Both are within 10 in EBIC of a faint effect."""
    t = times()

    def simulate(settings):
        line, more = sizes(settings, "line", "more")
        return [line * np.sin(7 * t) + more * np.cos(11 * t)]

    effects, size = candidates("line", "more"), 2.0 / np.sqrt(1000)
    (values,) = simulate(of_size(line=size))
    hypotheses = Hypotheses(Residuals(simulate, measured(values, 1.0, 1)), effects)
    line = hypotheses.fitted(effects[:1], of_size(line=size))
    wider = hypotheses.fitted(effects, of_size(line=size, more=size))
    assert abs(hypotheses.ebic(hypotheses.null) - hypotheses.ebic(line)) < 10
    assert abs(hypotheses.ebic(wider) - hypotheses.ebic(line)) < 10
    assert alternatives(hypotheses, Screening(hypotheses), line) == ()


def of_pairs(apart):
    """The verdict on A + D, which is B + C but for `apart` of another shape."""
    t = times()
    u, v, w, z = (np.sin(f * t) for f in (7.0, 11.0, 17.0, 23.0))
    shapes = {"A": u + v, "B": u + w, "C": v + z + apart * np.cos(29 * t), "D": w + z}

    def simulate(settings):
        return [sum((own["size"] * shapes[name] for name, own in settings.items()), 0 * t)]

    return diagnosed(simulate, candidates(*shapes), of_size(A=1.0, D=1.0), 1.0, 1)


def test_two_pairs_of_effects_that_explain_the_same_are_alternatives_as_sets():
    """A + D = B + C up to a little of another shape; no single effect stands for another one."""
    verdict = of_pairs(0.05)
    assert verdict.verdict == "ambiguous"
    named = {effect.name for effect in verdict.effects}
    assert [named, *map(set, verdict.alternatives)] in ([{"A", "D"}, {"B", "C"}],
                                                        [{"B", "C"}, {"A", "D"}])  # fmt: skip
    (other,) = verdict.alternatives
    for effect in verdict.effects:
        assert effect.indistinguishable_from == list(other)
        assert all(delta < 10 for delta in effect.rivals.values())
        for settings in effect.alternatives.values():
            assert settings.keys() == set(other)
            assert [own["size"] for own in settings.values()] == pytest.approx([1.0] * 2, abs=0.1)


def test_pairs_that_the_data_can_tell_apart_are_no_alternatives():
    verdict = of_pairs(0.3)
    assert (verdict.verdict, verdict.alternatives) == ("named", ())
    assert {effect.name for effect in verdict.effects} == {"A", "D"}


def test_an_alternative_is_found_beside_an_effect_that_would_take_its_place():
    """`bent` changes its shape with its size: without `late` it fits best where it is another."""
    t = times()

    def simulate(settings):
        late, slow, bent = sizes(settings, "late", "slow", "bent")
        curved = np.sin((1 + 0.6 * bent) * 3 * t) - np.sin(3 * t)
        return [late * np.sin(3 * t) + slow * (np.sin(3 * t) + 2e-4 * np.cos(5 * t)) + curved]

    truth = of_size(late=5.0, bent=0.8)
    verdict = diagnosed(simulate, candidates("late", "slow", "bent"), truth, 0.05, seed=1)
    assert verdict.verdict == "ambiguous"
    told = {
        frozenset(effect.name for effect in verdict.effects),
        *map(frozenset, verdict.alternatives),
    }
    assert {frozenset({"bent", "slow"}), frozenset({"bent", "late"})} <= told


def test_a_weak_alternative_that_does_a_little_worse_is_found_at_its_own_size():
    """`bent` is probed at 0.25 V, where it is less like `straight` than at 0.1 V."""
    t = times()

    def simulate(settings):
        straight, bent = sizes(settings, "straight", "bent")
        own = np.sin(7 * t) + 0.2 * np.cos(5 * t) + 1.5 * bent * np.cos(11 * t)
        return [straight * np.sin(7 * t) + bent * own]

    effects = candidates("straight", "bent", size=Parameter("size", "V", -10.0, 10.0, (0.25,)))
    verdict = diagnosed(simulate, effects, of_size(straight=0.1), 0.25, seed=2)
    assert verdict.verdict == "ambiguous"
    assert family(verdict.effects[0]) == {"straight", "bent"}


def test_an_alternative_has_the_form_of_the_effect_that_it_replaces():
    """`falling` is `dry` and `drag` in one, and 0.4 rad late; the plain forms take 0.2 for granted.

    In its plain form `dry` is 60 standard deviations off, and its fit given up.
    """
    t = times()

    def dry(size, late):
        return size * np.sin(7 * t - late)

    def simulate(settings):
        told = 0.0 * t
        for name in settings.keys() & {"dry", "falling"}:
            told = told + dry(settings[name]["size"], settings[name]["late"])
        for name in settings.keys() & {"drag", "falling"}:
            more = settings[name]["more"]
            told = told + (more + 2.0 * (more - 0.9) ** 2) * np.sin(11 * t)
        return [told]

    size, more = (Parameter(name, "V", -10.0, 10.0, (0.9,)) for name in ("size", "more"))
    late = Parameter("late", "1", 0.0, 1.0, (0.2,), Role.SHAPE)
    both = {"form": "late fitted", "extends": ""}
    effects = [
        Candidate("falling", (size, more), fixed={"late": 0.2}),
        falling := Candidate("falling", (size, more, late), **both),
        Candidate("dry", (size,), fixed={"late": 0.2}),
        Candidate("dry", (size, late), **both),
        Candidate("drag", (more,)),
    ]
    truth = {"falling": {"size": 1.0, "more": 0.8, "late": 0.4}}
    hypotheses = Hypotheses(Residuals(simulate, measured(simulate(truth)[0], 0.1, 1)), effects)
    best = hypotheses.fitted([falling], truth)
    (other,) = alternatives(hypotheses, Screening(hypotheses), best)
    assert other.names == {"dry", "drag"}
    assert other.settings["dry"]["late"] == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(("above", "needed"), [(2.0, False), (11.0, True)])
def test_an_effect_without_which_a_set_is_an_alternative_is_not_needed(above, needed):
    """Alternatives beside noise with a memory are credited with what the answer leaves more."""
    fit, less, best = (SimpleNamespace(ebic=ebic) for ebic in (130.0, 120.0, 100.0))
    hypotheses = SimpleNamespace(
        without=lambda fit, name, limit: less,
        limit=lambda fit: Limit(120.0),
        ebic=lambda fit: fit.ebic,
        evidence=SimpleNamespace(above=lambda fit, best: above),
    )
    assert _is_needed(hypotheses, fit, "effect", best) is needed


def test_what_may_be_there_in_place_of_a_calibration_makes_no_effect_ambiguous():
    t = times()
    within = Parameter("size", "V", -10.0, 10.0, (1.0,), tolerated=(-1.0, 1.0))
    effects = [*candidates("true"), *candidates("mass", size=within), *candidates("gain")]

    def simulate(settings):
        true, mass, gain = sizes(settings, "true", "mass", "gain")
        return [true * np.sin(7 * t) + mass * np.cos(3 * t) + gain * np.cos(3 * t + 0.01)]

    verdict = diagnosed(simulate, effects, of_size(true=1.0, mass=0.1), 0.2, 4)
    assert (verdict.verdict, names(verdict)) == ("named", {"true"})
    (mass,) = verdict.calibration
    assert mass.indistinguishable_from == ["gain"]
    assert ("gain", "true") in verdict.alternatives


def test_no_set_that_contains_an_alternative_is_fitted():
    """`twin` does as well as the answer `one`; eight other candidates explain nothing."""
    t, absent, said = times(), [f"absent {f}" for f in range(30, 38)], []

    def simulate(settings):
        one, twin, *others = sizes(settings, "one", "twin", *absent)
        lines = (size * np.sin(f * t) for f, size in enumerate(others, start=30))
        return [(one + twin) * np.sin(7 * t) + twin * 1e-3 * np.sin(3 * t) + sum(lines)]

    effects = candidates("one", "twin", *absent)
    verdict = diagnosed(simulate, effects, of_size(one=1.0), 0.1, 1, progress=said.append)
    assert [set(a) for a in verdict.alternatives] == [{"twin"}]
    assert "fitting twin" in said
    assert not [line for line in said if line.startswith("fitting") and "absent" in line]


@pytest.mark.parametrize(("share", "alike"), [(0.01, {"bent"}), (0.05, set())])
def test_a_set_that_predicts_the_same_to_a_tenth_of_the_noise_is_alike(share, alike):
    """20,000 samples tell 4 and 18 % of the noise from nothing, by 25 and 600 in chi-squared."""
    t = times(20_000)

    def simulate(settings):
        straight, bent = sizes(settings, "straight", "bent")
        return [(straight + bent) * np.sin(7 * t) + share * bent * np.cos(11 * t)]

    effects = candidates("straight", "bent")
    verdict = diagnosed(simulate, effects, of_size(straight=0.4), 0.08, 1)
    assert (verdict.verdict, names(verdict)) == ("named", {"straight"})
    assert set().union(*(other.names for other in verdict.alike)) == alike
    assert all(other.delta_ebic > 10 for other in verdict.alike)


def test_of_a_weak_effect_no_other_one_is_alike_unless_it_does_the_same():
    """An effect of an eighth of the noise, and another one of half that response."""
    t = times(20_000)

    def simulate(settings):
        straight, bent = sizes(settings, "straight", "bent")
        return [(straight + bent) * np.sin(7 * t) + bent * np.cos(11 * t)]

    verdict = diagnosed(simulate, candidates("straight", "bent"), of_size(straight=0.4), 2.3, 1)
    assert (verdict.verdict, names(verdict)) == ("named", {"straight"})
    assert not verdict.alike


@pytest.mark.parametrize("mass", [1.9, 2.08])
def test_a_number_that_the_answer_makes_up_for_begins_where_that_is_it(mass):
    """A gain and a friction, both over a mass of 2 that is off: the gain goes, the mass comes."""
    t = times()

    def simulate(settings):
        gain, friction = sizes(settings, "gain", "friction")
        own = settings.get("mass", {}).get("m", 2.0)
        return [((1 + gain) * np.cos(3 * t) + friction * np.sign(np.sin(7 * t))) / own]

    (values,) = simulate({"friction": {"size": 0.5}, "mass": {"m": mass}})
    effects = candidates("gain", "friction")
    number = Parameter("m", "kg", 1.0, 3.0, (2.1,), null=2.0, tolerated=(1.8, 2.2))
    other = Parameter("size", "V", -10.0, 10.0, (1.0,), null=0.0, tolerated=(-1.0, 1.0))
    catalogue = [*effects, Candidate("mass", (number,)), Candidate("other", (other,))]
    residuals = Residuals(simulate, measured(values, 0.01, 2))
    hypotheses = Hypotheses(residuals, catalogue)
    best = hypotheses.fitted(effects, of_size(gain=0.1, friction=0.1))
    (_, start), (_, instead) = _exchanged(hypotheses, Screening(hypotheses), best)
    # In turn of the names: in place of the friction, which no gain makes up for, and of the gain.
    assert start.keys() == {"gain", "mass"}
    assert instead["mass"]["m"] == pytest.approx(mass, rel=0.005)
    assert instead["friction"]["size"] == pytest.approx(0.5, rel=0.01)
