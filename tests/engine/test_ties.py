"""Explanations that the data do not tell apart: which of them is named does not depend on them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import fft, signal

from helpers.signals import candidates, diagnosed, measured, of_size, sizes, times
from mopro.engine.fits import Evidence, Fit
from mopro.engine.freeform import WithLaws
from mopro.engine.passes.alternatives import better_alternative, find_alternatives
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.state import Problem, State
from mopro.engine.verdict import Rejected

TWINS = ("stretched", "amplified")


@pytest.mark.parametrize("catalogue", [TWINS, TWINS[::-1]])
@pytest.mark.parametrize("parted_by", [-1e-12, 1e-12])
@pytest.mark.parametrize("other", [0.0, 1.0])
def test_of_two_effects_of_one_response_the_first_in_the_catalogue_is_named(
    catalogue, parted_by, other
):
    t = times()

    def simulate(settings):
        stretched, amplified, hum = sizes(settings, *TWINS, "hum")
        parted = np.sin(7 * t) + parted_by * np.cos(11 * t)
        return [stretched * np.sin(7 * t) + amplified * parted + hum * np.sin(23 * t)]

    truth = of_size(stretched=1.0, hum=other)
    verdict = diagnosed(simulate, candidates(*catalogue, "hum"), truth, 0.2, 1)
    named = {effect.name: effect.indistinguishable_from for effect in verdict.effects}
    assert named[catalogue[0]] == [catalogue[1]]


def left(chi2, *effects):
    """A fit of these effects that leaves so much."""
    order = tuple((effect.name, p) for effect in effects for p in effect.parameters)
    settings = of_size(**{effect.name: 1.0 for effect in effects})
    residual = np.r_[np.zeros(99), math.sqrt(chi2)]
    return Fit(effects, (), order, settings, residual, np.eye(100, len(order)), 100)


@pytest.mark.parametrize(("lower_by", "lowest"), [(0.9, "first"), (1.1, "second")])
def test_of_explanations_that_cannot_be_told_apart_the_first_in_the_catalogue_is_taken(
    lower_by, lowest
):
    first, second = candidates("first", "second")
    evidence = Evidence(Noise((100,), (0,), (True,)), [first.key, second.key])
    fits = [left(5.0 - lower_by, second), left(5.0, first)]
    assert evidence.lowest(fits).names == {lowest}


@pytest.mark.parametrize(("lower_by", "lowest"), [(0.9, {"last"}), (1.1, {"first", "second"})])
def test_of_explanations_that_cannot_be_told_apart_the_simplest_is_taken(lower_by, lowest):
    effects = first, second, last = candidates("first", "second", "last")
    evidence = Evidence(Noise((100,), (0,), (True,)), [effect.key for effect in effects])
    one, two = left(50.0, last), left(50.0, first, second)
    more = evidence.ebic(two) - evidence.ebic(one)
    fits = [one, left(50.0 - more - lower_by, first, second)]
    assert evidence.lowest(fits).names == lowest


@pytest.mark.parametrize(("dropped", "named"), [((), "stretched"), (("stretched",), "amplified")])
def test_an_equal_set_takes_the_answer_s_place_unless_it_was_dropped(dropped, named):
    """The search met the second of two twins first; the other one is listed before it."""
    t = times()

    def simulate(settings):
        stretched, amplified = sizes(settings, *TWINS)
        return [(stretched + amplified) * np.sin(7 * t)]

    data = tuple(measured(simulate(of_size(stretched=1.0))[0], 0.2, 1))
    model, effects = WithLaws(simulate, data, ()), tuple(candidates(*TWINS))
    state = State.of(Problem(model, None, None, effects, (), (), data, 1, lambda _: None))
    fit = state.hypotheses.fitted([effects[1]], of_size(amplified=0.5))
    rejected = tuple(Rejected(name, 1.0, "a reason") for name in dropped)
    found = find_alternatives(replace(state, fit=fit, rejected=rejected))
    assert found.fit.names == {named}


@pytest.mark.parametrize("seed", range(5))
def test_of_two_sets_beside_coloured_noise_one_is_better_whichever_is_the_answer(seed):
    """Each leaves the noise and a slow error of its own, of the same size."""
    rng = np.random.default_rng(seed)
    noise = signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal(1000))
    first, second = candidates("first", "second")
    catalogue, found = [first.key, second.key], []
    slow = [fft.idct(np.r_[rng.standard_normal(30), np.zeros(970)], norm="ortho") for _ in "12"]
    one, other = (
        Fit((effect,), (), (), {}, noise + 8.0 * own, np.zeros((1000, 0)), 1000)
        for effect, own in zip((first, second), slow, strict=True)
    )
    for best, fit in ((one, other), (other, one)):
        evidence = Evidence(Noise((999,), (0,), (True,)).like(best.residual), catalogue)
        found.append((evidence.above(fit, best), evidence.ebic(fit) - evidence.ebic(best)))
    (forth, forth_alone), (back, back_alone) = found
    # By what it leaves alone, either is better than the other.
    assert min(forth_alone, back_alone) > 0.0
    assert min(forth, back) == 0.0
    assert max(forth, back) == pytest.approx(abs(forth_alone - back_alone))


def test_a_set_with_strong_evidence_over_the_answer_is_where_the_passes_begin_again():
    """It has not been through them, as one that does equally well has by the answer's."""
    t = times()

    def simulate(settings):
        similar, true = sizes(settings, "similar", "true")
        return [true * np.sin(7 * t) + similar * np.sin(7 * t + 0.3)]

    data = tuple(measured(simulate(of_size(true=1.0))[0], 1.0, 1))
    model, effects = WithLaws(simulate, data, ()), tuple(candidates("similar", "true"))
    state = State.of(Problem(model, None, None, effects, (), (), data, 1, lambda _: None))
    found = find_alternatives(
        replace(state, fit=state.hypotheses.fitted([effects[0]], of_size(similar=1.0)))
    )
    better = better_alternative(found)
    assert (found.fit.names, better.names) == ({"similar"}, {"true"})
    assert state.hypotheses.ebic(better) < state.hypotheses.ebic(found.fit) - 3.0
