"""Effects beside something unexplained that is larger than what they explain."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, diagnosed, measured, names, of_size, sizes, times
from mopro.engine import Parameter, reconcile
from mopro.engine.freeform import WithLaws, measurement_laws
from mopro.engine.passes import drop_outweighed, in_turn, set_laws_apart
from mopro.engine.state import Problem, State

T = times(2000)
# The response to something in no catalogue, and a listed one that has much in common with it.
UNLISTED = np.sin(2 * T**2)
LISTED = 0.8 * UNLISTED + np.cos(3 * T**2)
SHARED = float(UNLISTED @ LISTED) ** 2 / float(UNLISTED @ UNLISTED) / float(LISTED @ LISTED)


def model(settings):
    listed, unlisted = sizes(settings, "listed", "unlisted")
    return [listed * LISTED + unlisted * UNLISTED]


def test_what_resembles_a_larger_unlisted_cause_is_not_named_and_the_reason_is_given():
    assert 0.1 < SHARED < 0.5
    verdict = diagnosed(model, candidates("listed"), of_size(unlisted=1.0), 0.05, seed=1)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    (rejected,) = [r for r in verdict.rejected if r.name == "listed"]
    assert rejected.reason == "explains less than what stays unexplained beside it"
    explained = 0.05**-2 * float(UNLISTED @ UNLISTED) * SHARED
    assert rejected.gain == pytest.approx(explained, rel=0.1)


def test_what_explains_more_than_stays_unexplained_is_named():
    truth = of_size(listed=2.0, unlisted=0.5)
    verdict = diagnosed(model, candidates("listed"), truth, 0.05, seed=1)
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"listed"})


def test_what_a_draft_describes_does_not_stay_unexplained():
    """A mass of 0.33 N rms is named beside a dry friction of 0.5 N; the noise is 0.14 N."""
    speed = 0.6 * np.cos(6.0 * T) + 0.5 * np.cos(17.0 * T)
    acceleration = -3.6 * np.sin(6.0 * T) - 8.5 * np.sin(17.0 * T)

    def force(settings):
        mass, friction = sizes(settings, "mass", "friction")
        return [mass * acceleration + friction * np.sign(speed)]

    (values,) = force(of_size(mass=0.05, friction=0.5))
    (series,) = measured(values, 0.14, seed=1)
    labelled = replace(series, labels={"velocity": speed, "acceleration": acceleration})
    verdict = reconcile(force, candidates("mass"), [labelled])
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"mass"})
    (draft,) = verdict.drafts
    assert draft.of == "sgn v"
    low, high = verdict.effects[0].parameters["size"].ci95
    assert low <= 0.05 <= high


def test_a_calibration_names_nothing_and_stays():
    within = Parameter("size", "V", -10.0, 10.0, (1.0,), tolerated=(-1.0, 1.0))
    unlisted = of_size(unlisted=1.0)
    verdict = diagnosed(model, candidates("listed", size=within), unlisted, 0.05, seed=1)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    assert [effect.name for effect in verdict.calibration] == ["listed"]


def test_it_is_asked_again_by_the_noise_that_the_listed_effects_leave():
    """Then an outweighed effect goes that an earlier pass has kept."""
    (values,) = model(of_size(unlisted=1.0))
    data, listed = measured(values, 0.05, seed=1), candidates("listed")
    simulate = WithLaws(model, data, ())
    problem = Problem(simulate, None, None, tuple(listed), (), (), tuple(data), 1, lambda _: None)
    state = State.of(problem)
    fit = state.hypotheses.fitted(listed, of_size(listed=0.5))
    apart = in_turn((set_laws_apart, drop_outweighed), replace(state, fit=fit))
    assert (fit.names, apart.fit.names) == ({"listed"}, set())
    (rejected,) = apart.rejected
    assert rejected.reason == "explains less than what stays unexplained beside it"


def test_an_effect_whose_place_a_term_would_fill_explains_what_the_term_does_not():
    """A ripple of 1 V beside a line of 0.2 V and another period, which by itself replaces it.

    A chirp of 0.3 V, which stays unexplained, is larger than the line.
    """
    place = 3.0 * T / 5.0 + np.sin(T)

    def ripple(settings):
        (size,) = sizes(settings, "ripple")
        return [size * np.sin(2 * np.pi * place / 0.5)]

    others = 0.2 * np.sin(2 * np.pi * place / 0.19) + 0.3 * np.sin(9 * T**2)
    (series,) = measured(ripple(of_size(ripple=1.0))[0] + others, 0.05, seed=1)
    data = (replace(series, labels={"position": place}),)
    (line,) = [c for c in measurement_laws(data) if c.name == "line in position in probe"]
    listed = candidates("ripple")
    simulate = WithLaws(ripple, data, [line])
    problem = Problem(simulate, None, None, tuple(listed), (), (), data, 1, lambda _: None)
    state = State.of(problem)
    hypotheses = state.hypotheses
    hypotheses.join([line], simulate, None)
    # As a search does that begins without effects.
    instead = hypotheses.fitted([line], {line.name: {"p": 0.5, "s": 1.0, "c": 0.0}})
    beside = {line.name: {"p": 0.19, "s": 0.2, "c": 0.0}, **of_size(ripple=1.0)}
    fit = hypotheses.fitted([*listed, line], beside)
    assert hypotheses.without(fit, "ripple") is instead
    assert instead.rss - fit.rss < fit.rss - fit.count
    kept = drop_outweighed(replace(state, fit=fit))
    assert (kept.fit.names, kept.rejected) == ({"ripple", line.name}, ())
