"""Passes that drop effects from the answer."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.assumed import STRONG
from mopro.engine.fits import explained_by
from mopro.engine.passes.loops import a_pass
from mopro.engine.state import State
from mopro.engine.verdict import Rejected

FAILS_HELD_OUT = "lowers chi-squared where it is fitted, and raises it where it is held out"
NO_GAIN = "lowers the EBIC by less than a Bayes factor of 20 beside what remains"
_OUTWEIGHED = "explains less than what stays unexplained beside it"


@a_pass
def eliminate(state: State) -> State:
    """The answer without effects that save less than strong evidence, a Bayes factor of 20."""
    fit, rejected = state.fit, list(state.rejected)
    while fit.candidates:
        reduced = [(state.hypotheses.without(fit, name), name) for name in sorted(fit.names)]
        best, name = min(reduced, key=lambda pair: state.hypotheses.ebic(pair[0]))
        if state.hypotheses.ebic(best) > state.hypotheses.ebic(fit) + STRONG:
            break
        rejected.append(Rejected(name, best.rss - fit.rss, NO_GAIN))
        fit = best
    return replace(state, fit=fit, rejected=tuple(rejected))


@a_pass
def hold_out(state: State) -> State:
    """The answer without effects that held-out parts do not support.

    Of several the one is dropped first that the data miss least: one whose absence leaves
    much may fail for what another one does beside it.
    """
    hypotheses, fit, rejected = state.hypotheses, state.fit, list(state.rejected)
    while (held := hypotheses.held_out(fit)) is not None:
        failing = [name for name in sorted(fit.names) if not held.supports(name)]
        if not failing:
            break
        without = {name: hypotheses.without(fit, name) for name in failing}
        worst = min(failing, key=lambda name: hypotheses.ebic(without[name]))
        rejected.append(Rejected(worst, without[worst].rss - fit.rss, FAILS_HELD_OUT))
        fit = without[worst]
    return replace(state, fit=fit, held=held, rejected=tuple(rejected))


@a_pass
def drop_outweighed(state: State) -> State:
    """The answer without effects that explain less than stays unexplained, the least dropped first.

    What nobody listed is there and is the larger: by itself it looks like several listed effects
    as well, in every part of the data. What free-form terms describe, also as drafts, does not
    stay unexplained. Calibrations, which name nothing, stay.
    """
    hypotheses = state.hypotheses
    while not hypotheses.leaves_noise(described := state.drafted or state.fit):
        left = described.rss - hypotheses.noise_rss(described)
        fit = state.fit
        listed = sorted(
            c.name
            for c in fit.candidates
            if not c.law and not hypotheses.evidence.calibrated(fit, c)
        )
        gains = {name: hypotheses.without(fit, name).rss - fit.rss for name in listed}
        weak = (n for n in sorted(listed, key=gains.__getitem__) if gains[n] < left)
        # An effect whose place a term would fill explains more than its absence costs.
        name = next(
            (n for n in weak if not fit.laws or explained_by(hypotheses.residuals, fit, n) < left),
            None,
        )
        if name is None:
            break
        dropped = Rejected(name, gains[name], _OUTWEIGHED)
        drafted = state.drafted and hypotheses.without(state.drafted, name)
        rejected = (*state.rejected, dropped)
        fit = hypotheses.without(fit, name)
        state = replace(state, fit=fit, drafted=drafted, drafted_held=None, rejected=rejected)
    return state


@a_pass
def hold_out_again(state: State) -> State:
    """Held-out parts with and without each effect, and each draft, where that is not known."""
    held, drafted_held = state.held, state.drafted_held
    if state.drafted is not None and drafted_held is None:
        drafted_held = state.hypotheses.held_out(state.drafted)
    if held is None:
        held = state.hypotheses.held_out(state.fit)
    return replace(state, held=held, drafted_held=drafted_held)
