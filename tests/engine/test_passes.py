"""The passes: pure, in one tuple that the caller may change, with a trace of what each did."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from helpers.signals import candidates, diagnosed, measured, names, of_size, sizes, times
from mopro.engine import PASSES, State, a_pass, reconcile, until_stable, where
from mopro.engine.freeform import WithLaws
from mopro.engine.passes import Loop, search_catalogue
from mopro.engine.state import Problem

T = times()


def model(settings):
    up, down = sizes(settings, "up", "down")
    return [up * np.sin(7 * T) + down * np.cos(11 * T)]


def state():
    data = tuple(measured(model(of_size(up=1.0))[0] + 0.5 * np.sign(np.sin(3 * T)), 0.1, 1))
    effects = tuple(candidates("up", "down"))
    simulate = WithLaws(model, data, ())
    return State.of(Problem(simulate, None, None, effects, (), (), data, 1, lambda _: None))


def flat(passes):
    for each in passes:
        yield from flat(each.passes) if isinstance(each, Loop) else [each]


def told(one):
    """Fits, catalogue, answer and remarks of a state."""
    fits = {fit.key: (fit.rss, fit.settings) for fit in one.hypotheses.ranked()}
    catalogue = [c.key for c in one.hypotheses.catalogue]
    return fits, one.fit.key, catalogue, one.rejected, one.notes


def test_a_pass_leaves_the_state_that_it_is_given_as_it_was_and_does_the_same_again():
    at = state()
    for each in flat(PASSES):
        before = told(at)
        once, again = each(at), each(at)
        assert told(at) == before, each.__name__
        assert told(once)[1:] == told(again)[1:]
        at = once
    assert at.fit.names


def test_the_trace_leads_from_no_effects_to_the_answer_pass_by_pass():
    verdict = diagnosed(model, candidates("up", "down"), of_size(up=1.0), 0.1, 1)
    assert [taken.name for taken in verdict.trace if taken.decides] == ["search_catalogue"]
    assert verdict.trace[0].before == ()
    assert set(verdict.trace[-1].after) == names(verdict) == {"up"}
    for one, other in zip(verdict.trace, verdict.trace[1:], strict=False):
        assert one.after == other.before
    assert {taken.name for taken in verdict.trace} <= {each.__name__ for each in flat(PASSES)}
    assert json.loads(json.dumps(verdict.as_json()["trace"], allow_nan=False))[1]["after"] == ["up"]


def test_the_caller_may_state_other_passes_and_write_one():
    @a_pass
    def forget(state):
        """No effect, whatever was found."""
        return replace(state, fit=state.hypotheses.null)

    data = measured(model(of_size(up=1.0))[0], 0.1, 1)
    found = reconcile(model, candidates("up", "down"), data, passes=(search_catalogue,))
    assert ([t.name for t in found.trace], names(found)) == (["search_catalogue"], {"up"})
    passes = (search_catalogue, where(lambda state: bool(state.fit.names), forget))
    gone = reconcile(model, candidates("up", "down"), data, passes=passes)
    assert ([t.name for t in gone.trace], names(gone)) == (["search_catalogue", "forget"], set())


def test_a_loop_takes_its_passes_until_the_effects_of_the_answer_stay():
    said = []

    def once(state):
        said.append(state.fit.names)
        return replace(state, fit=state.hypotheses.null)

    at = search_catalogue(state())
    assert until_stable(once)(at).fit.names == set()
    assert said == [at.fit.names, set()]


LIGHT = """
import sys, mopro.engine as engine
engine.reconcile, engine.PASSES
print({"click", "lark", "numba", "rich", "pyarrow", "matplotlib"} & sys.modules.keys())
print({m for m in sys.modules if m.startswith("mopro.") and not m.startswith("mopro.engine")})
"""


def test_the_engine_loads_no_other_room_and_no_library_of_one():
    done = subprocess.run([sys.executable, "-c", LIGHT], check=True, capture_output=True, text=True)
    assert done.stdout == "set()\nset()\n"


@pytest.mark.parametrize("text", ["\x1b[31m", "<script>"])
def test_a_verdict_shows_itself_as_text_and_as_markup(text):
    verdict = diagnosed(model, candidates("up", "down"), of_size(up=1.0), 0.1, 1)
    first, second, third = str(verdict).splitlines()
    assert first == "Verdict: named"
    assert second.startswith("up: size = ")
    assert third.startswith("run, probe: rms ")
    shown = replace(verdict, notes=(text,))._repr_html_()
    assert text not in shown
