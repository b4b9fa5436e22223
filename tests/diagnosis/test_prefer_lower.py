"""The choice among fitted sets that is made again once an effect of the answer is dropped."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, measured, of_size, sizes, times
from mopro.diagnosis.laws import WithLaws
from mopro.diagnosis.passes import prefer_lower
from mopro.diagnosis.state import Problem, State
from mopro.diagnosis.verdict import Rejected

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
    problem = Problem(simulate, None, effects, (), (), data, 1, lambda _: None)
    state = State.of(problem)
    fits = {c.name: state.sets.fitted([c], of_size(**{c.name: 0.5})) for c in effects}
    assert state.sets.ebic(fits["true"]) < state.sets.ebic(fits["similar"])
    return replace(state, fit=fits["similar"])


def answer(state, *dropped):
    rejected = tuple(Rejected(name, 1.0, "a reason") for name in dropped)
    return prefer_lower(replace(state, rejected=rejected)).fit.names


def test_a_lower_set_of_as_many_effects_is_taken_once_one_was_dropped(state):
    assert answer(state, "third") == {"true"}


def test_a_dropped_effect_does_not_come_back(state):
    assert answer(state, "true") == {"similar"}


def test_nothing_changes_where_nothing_was_dropped(state):
    assert answer(state) == {"similar"}
