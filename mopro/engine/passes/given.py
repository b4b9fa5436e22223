"""A pass for effects that are known beforehand, whose sizes alone are asked for."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.passes.loops import Pass, a_pass
from mopro.engine.series import Settings
from mopro.engine.state import State


def fit_given(start: Settings) -> Pass:
    """The pass to an answer of all effects of the catalogue together, fitted from `start`."""

    def fitted(state: State) -> State:
        hypotheses = state.hypotheses
        begun = {**hypotheses.null.settings, **start}
        fit = hypotheses.settled(hypotheses.fitted(hypotheses.catalogue, begun))
        hypotheses.judge_by(fit)
        return replace(state, fit=fit)

    return a_pass(fitted)
