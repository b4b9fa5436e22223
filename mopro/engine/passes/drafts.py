"""Passes on drafts: the listed effects by themselves, and the free-form terms beside them."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.passes.drop import NO_GAIN
from mopro.engine.passes.loops import a_pass
from mopro.engine.search.neighbours import in_other_forms
from mopro.engine.state import State
from mopro.engine.verdict import Rejected


@a_pass
def set_laws_apart(state: State) -> State:
    """The listed effects by themselves, with the free-form terms as drafts of what they leave.

    A term fitted together with an effect may take a part of it. From here on the noise is what
    the effects leave, and each must be supported beside it, unless both leave white noise.
    """
    sets, fit, rejected = state.sets, state.fit, list(state.rejected)
    for name in sorted(fit.laws):
        fit = sets.without(fit, name)
    # One that only made up for a term takes a place where it raises chi-squared.
    while reduced := [
        (n, r) for n in sorted(fit.names) if (r := sets.without(fit, n)).rss <= fit.rss
    ]:
        name, less = reduced[0]
        rejected.append(Rejected(name, less.rss - fit.rss, NO_GAIN))
        fit = less
    sets.judge_by(fit)
    state, beside = replace(state, fit=fit, rejected=tuple(rejected)), state
    if not beside.fit.laws:
        return state
    # Beside the terms an effect may have had another form.
    fit = sets.evidence.lowest([fit, *sets.fit_all(in_other_forms(sets, fit))])
    return replace(state, fit=fit, held=None, drafted=beside.fit, drafted_held=beside.held)


def something_is_left(state: State) -> bool:
    """True if the answer with its drafts leaves more than white noise.

    What they leave nothing for, an effect cannot stand for: those beside the drafts are there.
    """
    return not state.sets.is_noise(state.drafted or state.fit)
