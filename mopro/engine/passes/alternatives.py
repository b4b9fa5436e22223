"""Passes on what explains the data as well: alternatives, and the answer taken again from one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mopro.engine.assumed import STRONG, VERY_STRONG
from mopro.engine.fits import Fit, Key
from mopro.engine.passes.loops import Loop, Pass, a_pass, in_turn
from mopro.engine.search.alternatives import Alternative, alternatives
from mopro.engine.state import State


@a_pass
def find_alternatives(state: State) -> State:
    """Other sets that the data cannot distinguish from the answer.

    One that explains them equally well takes its place if its effects are listed before. Of those
    with free-form terms the best is told apart: what somebody has listed has the benefit of the
    doubt.
    """
    if not state.fit.candidates:
        return state
    every = alternatives(state.hypotheses, state.screening, state.fit)
    if (first := _listed_first(state, every)) is not state:
        state = first
        every = alternatives(state.hypotheses, state.screening, state.fit)
    listed = tuple(other for other in every if not other.laws)
    names = next((other.names for other in every if other.laws), None)
    rival = next((fit for fit in state.hypotheses.ranked() if fit.names == names), None)
    state = replace(state, alternatives=listed, rival=rival)
    if rival is None or state.drafted is not None:
        return state
    return replace(state, drafted_held=state.hypotheses.held_out(rival))


def _listed_first(state: State, every: Sequence[Alternative]) -> State:
    """The state with that one of equal sets whose effects are listed first.

    Which of them the search meets first is up to rounding. A set with strong evidence over the
    answer is none of them: the passes are taken again from there (`better_alternative`). With
    drafts beside it the answer stays, and what was dropped from it stays away.
    """
    hypotheses, dropped = state.hypotheses, {r.name for r in state.rejected}
    names = {other.names for other in every if not other.laws and not dropped & other.names}
    least = hypotheses.ebic(state.fit) - STRONG
    equal = [
        fit for fit in hypotheses.ranked() if fit.names in names and hypotheses.ebic(fit) >= least
    ]
    first = hypotheses.evidence.lowest([state.fit, *equal])
    if state.drafted is not None or first is state.fit:
        return state
    held = hypotheses.held_out(first)
    if held is None or not all(map(held.supports, first.names)):
        return state
    return replace(state, fit=first, held=held)


def better_alternative(state: State) -> Fit | None:
    """The fitted alternative that the data support strongly over the answer; None if none.

    A search that strong effects mislead may end in a set that a fit from elsewhere shows to be
    none of the best. What was dropped from the answer would be dropped again. A set with free-form
    terms of the model is one as well, beyond the benefit of the doubt that what is listed has.
    """
    dropped = {r.name for r in state.rejected}
    if (rival := state.rival) is not None and not dropped & rival.names:
        of_model = not any(c.law and c.law.of_data for c in rival.candidates)
        if (
            of_model
            and state.hypotheses.ebic(rival) < state.hypotheses.ebic(state.fit) - VERY_STRONG
        ):
            return rival
    better = {
        other.names
        for other in state.alternatives
        if other.delta_ebic < -STRONG and not dropped & other.names
    }
    return next((fit for fit in state.hypotheses.ranked() if fit.names in better), None)


@dataclass(frozen=True)
class _FromAlternatives(Loop):
    def __call__(self, state: State) -> State:
        state, known = in_turn(self.passes, state), set[Key]()
        while (better := better_alternative(state)) is not None and better.key not in known:
            known.add(better.key)
            # What the passes found out about the data, such as wild samples, holds.
            begun = state.begun(state.problem)
            fit = begun.hypotheses.fitted(better.candidates, better.settings)
            state = replace(begun, fit=fit).traced("from_alternatives", state)
            state = in_turn(self.passes, state)
        return state


def from_alternatives(*passes: Pass) -> Loop:
    """`passes` in turn, and again from an alternative with strong evidence over the answer."""
    return _FromAlternatives(passes)
