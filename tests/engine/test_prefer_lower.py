"""The passes that drop effects, and those that follow once some are dropped."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, measured, of_size, sizes, times
from mopro.engine.conclude import conclude
from mopro.engine.fits import HeldOut
from mopro.engine.freeform import WithLaws
from mopro.engine.passes import DROP, drop, hold_out, prefer_lower, readmit, set_laws_apart
from mopro.engine.passes.drop import FAILS_HELD_OUT
from mopro.engine.state import Problem, State
from mopro.engine.verdict import Rejected

T = times(2000)
NAMES = ("true", "similar", "third")
SHAPES = (np.sin(3 * T), np.sin(3 * T + 0.5), np.cos(11 * T))


def model(settings):
    return [sum(size * shape for size, shape in zip(sizes(settings, *NAMES), SHAPES, strict=True))]


@pytest.fixture
def state():
    """Two single effects fitted, of which the answer is the worse one."""
    data = tuple(measured(model(of_size(true=1.0))[0], 0.1, seed=3))
    simulate = WithLaws(model, data, ())
    effects = tuple(candidates(*NAMES))
    problem = Problem(simulate, None, None, effects, (), (), data, 1, lambda _: None)
    state = State.of(problem)
    fits = {c.name: state.hypotheses.fitted([c], of_size(**{c.name: 0.5})) for c in effects}
    assert state.hypotheses.ebic(fits["true"]) < state.hypotheses.ebic(fits["similar"])
    return replace(state, fit=fits["similar"])


def test_of_effects_that_held_out_parts_deny_the_one_that_is_missed_least_goes(monkeypatch, state):
    """Beside `third` the held-out parts deny `true` more, and without it support that."""
    both = [c for c in state.hypotheses.catalogue if c.name in ("true", "third")]
    fit = state.hypotheses.fitted(both, of_size(true=1.0, third=0.1))
    gains = {frozenset({"true", "third"}): {"true": -100.0, "third": -1.0}}

    def held_out(hypotheses, fit):
        own = gains.get(fit.names, dict.fromkeys(fit.names, 1.0))
        return HeldOut(2.0, 1.0, own, fit.residual)

    monkeypatch.setattr(drop, "held_of", held_out)
    answer = hold_out(replace(state, fit=fit))
    assert answer.fit.names == {"true"}
    assert [(r.name, r.reason) for r in answer.rejected] == [("third", FAILS_HELD_OUT)]


def test_once_held_out_parts_deny_an_effect_the_others_are_chosen_anew(monkeypatch, state):
    """Beside `third` the worse of two single effects was the better one."""
    both = [c for c in state.hypotheses.catalogue if c.name in ("similar", "third")]
    fit = state.hypotheses.fitted(both, of_size(similar=1.0, third=0.1))

    def held_out(hypotheses, fit):
        gains = {name: -1.0 if name == "third" else 1.0 for name in fit.names}
        return HeldOut(2.0, 1.0, gains, fit.residual)

    monkeypatch.setattr(drop, "held_of", held_out)
    answer = DROP(replace(state, fit=fit))
    assert answer.fit.names == {"true"}
    assert [r.name for r in answer.rejected] == ["third"]
    assert answer.held.residual is answer.fit.residual


def answer(state, *dropped):
    rejected = tuple(Rejected(name, 1.0, "a reason") for name in dropped)
    return prefer_lower(replace(state, rejected=rejected)).fit.names


def test_a_lower_set_of_as_many_effects_is_taken_once_one_was_dropped(state):
    assert answer(state, "third") == {"true"}


def test_a_dropped_effect_does_not_come_back(state):
    assert answer(state, "true") == {"similar"}


def test_nothing_changes_where_nothing_was_dropped(state):
    assert answer(state) == {"similar"}


def readmitted(state, *dropped):
    """The answer where effects were dropped one after the other, each with its reason."""
    rejected = tuple(Rejected(name, 1.0, reason) for name, reason in dropped)
    return readmit(DROP)(replace(state, fit=state.hypotheses.null, rejected=rejected))


def test_what_held_out_parts_denied_beside_others_comes_back_without_them(state):
    again = readmitted(state, ("true", FAILS_HELD_OUT), ("similar", "a reason"))
    assert again.fit.names == {"true"}
    assert [r.name for r in again.rejected] == ["similar"]
    assert again.held.supports("true")


@pytest.mark.parametrize(
    "dropped",
    [
        [("true", "a reason"), ("similar", "a reason")],
        [("similar", "a reason"), ("true", FAILS_HELD_OUT)],
        [("third", FAILS_HELD_OUT), ("similar", "a reason")],
    ],
    ids=["for another reason", "last", "not called for"],
)
def test_what_was_dropped_otherwise_stays_away(state, dropped):
    again = readmitted(state, *dropped)
    assert again.fit.names == set()
    assert [(r.name, r.reason) for r in again.rejected] == dropped


def test_an_effect_that_raises_chi_squared_goes_and_is_told_with_the_dropped(state):
    """A fit of two that ended above that of one of them."""
    both = [c for c in state.hypotheses.catalogue if c.name in ("true", "third")]
    fit = state.hypotheses.fitted(both, of_size(true=1.0, third=0.1))
    apart = set_laws_apart(replace(state, fit=replace(fit, residual=1.1 * fit.residual)))
    assert apart.fit.names == {"true"}
    assert [r.name for r in apart.rejected] == ["third"]
    assert answer(apart, "third") == {"true"}


def test_why_an_effect_is_not_in_the_answer_is_what_its_signature_says(state):
    """`true` would explain what nothing explains yet, and beside it `third` is not in the data."""

    def reasons(fit):
        return {r.name: r.reason for r in conclude(replace(state, fit=fit)).rejected}

    assert reasons(state.hypotheses.null)["true"].startswith("is predicted to lower chi-squared")
    assert reasons(state.hypotheses.best())["third"].startswith("lowers chi-squared by less than")
