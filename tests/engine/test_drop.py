"""The passes that drop effects."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, measured, of_size, sizes, times
from mopro.engine.answer import conclude
from mopro.engine.fits import HeldOut
from mopro.engine.freeform import WithLaws
from mopro.engine.passes import hold_out, set_laws_apart
from mopro.engine.passes.drop import FAILS_HELD_OUT
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.state import Problem, State

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
        return HeldOut("other runs", 2.0, 1.0, own, fit.residual)

    monkeypatch.setattr(Hypotheses, "held_out", held_out)
    answer = hold_out(replace(state, fit=fit))
    assert answer.fit.names == {"true"}
    assert [(r.name, r.reason) for r in answer.rejected] == [("third", FAILS_HELD_OUT)]


def test_an_effect_that_raises_chi_squared_goes_and_is_told_with_the_dropped(state):
    """A fit of two that ended above that of one of them."""
    both = [c for c in state.hypotheses.catalogue if c.name in ("true", "third")]
    fit = state.hypotheses.fitted(both, of_size(true=1.0, third=0.1))
    apart = set_laws_apart(replace(state, fit=replace(fit, residual=1.1 * fit.residual)))
    assert apart.fit.names == {"true"}
    assert [r.name for r in apart.rejected] == ["third"]


def test_why_an_effect_is_not_in_the_answer_is_what_its_signature_says(state):
    """`true` would explain what nothing explains yet, and beside it `third` is not in the data."""

    def reasons(fit):
        return {r.name: r.reason for r in conclude(replace(state, fit=fit)).rejected}

    assert reasons(state.hypotheses.null)["true"].startswith("is predicted to lower chi-squared")
    assert reasons(state.hypotheses.best())["third"].startswith("lowers chi-squared by less than")
