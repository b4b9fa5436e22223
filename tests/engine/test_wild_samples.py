"""The pass that sets wild samples aside, and when it asks for the search again."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, measured, of_size, sizes, times
from mopro.engine import diagnosis
from mopro.engine.freeform import WithLaws
from mopro.engine.passes import alternatives, search_catalogue, set_wild_aside
from mopro.engine.state import Problem, State


def simulate(settings):
    t = times()
    up, down = sizes(settings, "up", "down")
    return [up * np.sin(7 * t) + down * np.cos(11 * t)]


@pytest.mark.parametrize(("unlisted_V", "searched"), [(1.0, False), (0.0, True)])
def test_the_search_is_repeated_where_wild_samples_are_much_of_what_is_left(unlisted_V, searched):
    """One sample of 4 V beside 0.2 V of noise, with and without a wave that nobody listed."""
    (series,) = measured(
        simulate(of_size(up=2.0))[0] + unlisted_V * np.sin(17 * times()), 0.2, seed=1
    )
    values = series.values.copy()
    values[700] += 4.0
    data, said = (replace(series, values=values),), []
    model = WithLaws(simulate, data, ())
    catalogue = tuple(candidates("up", "down"))
    problem = Problem(model, None, None, catalogue, (), (), data, 1, said.append)
    found = search_catalogue(State.of(problem))
    said.clear()
    state = search_catalogue(set_wild_aside(found))
    assert any(line.startswith("simulating the signature") for line in said) is searched
    assert state.notes == ("probe in run has one wild sample, at 1.751 s: left out",)
    assert state.fit.names == {"up"}
    assert state.fit.settings["up"]["size"] == pytest.approx(2.0, abs=0.1)
    (left_out,) = state.hypotheses.residuals.data
    assert np.flatnonzero(left_out.wild).tolist() == [700]


def test_what_was_set_aside_stays_aside_where_the_passes_begin_again(monkeypatch):
    """From a set that was fitted beside the answer: the search before and after, and once more."""
    (series,) = measured(simulate(of_size(up=2.0))[0], 0.2, seed=1)
    values = series.values.copy()
    values[700] += 4.0
    begun, said = [], []

    def once(state):
        begun.append(state.fit)
        return state.fit if len(begun) == 1 else None

    monkeypatch.setattr(alternatives, "better_alternative", once)
    catalogue = candidates("up", "down")
    answer = diagnosis.reconcile(
        simulate, catalogue, [replace(series, values=values)], progress=said.append
    )
    assert (answer.verdict, len(begun)) == ("named", 2)
    assert said.count("simulating the signature of down") == 3
    assert answer.notes == ("probe in run has one wild sample, at 1.751 s: left out",)
