"""Passes on drafts and on what is left: effects by themselves, terms beside them, its tests."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.candidate import Law
from mopro.engine.fits import Fit
from mopro.engine.passes.drop import NO_GAIN
from mopro.engine.passes.loops import a_pass
from mopro.engine.residuals import Remainder, as_noise, examine
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.neighbours import in_other_forms
from mopro.engine.state import State
from mopro.engine.verdict import Rejected


@a_pass
def set_laws_apart(state: State) -> State:
    """The listed effects by themselves, with the free-form terms as drafts of what they leave.

    A term fitted together with an effect may take a part of it. From here on the noise is what
    the effects leave, and each must be supported beside it, unless both leave white noise.
    """
    hypotheses, fit, rejected = state.hypotheses, state.fit, list(state.rejected)
    for name in sorted(fit.laws):
        fit = hypotheses.without(fit, name)
    # One that only made up for a term takes a place where it raises chi-squared.
    while reduced := [
        (n, r) for n in sorted(fit.names) if (r := hypotheses.without(fit, n)).rss <= fit.rss
    ]:
        name, less = reduced[0]
        rejected.append(Rejected(name, less.rss - fit.rss, NO_GAIN))
        fit = less
    hypotheses.judge_by(fit)
    held = state.held if fit is state.fit else None
    state, beside = replace(state, fit=fit, held=held, rejected=tuple(rejected)), state
    if not beside.fit.laws:
        return state
    # Beside the terms an effect may have had another form.
    fit = hypotheses.evidence.lowest([fit, *hypotheses.fit_all(in_other_forms(hypotheses, fit))])
    return replace(state, fit=fit, held=None, drafted=beside.fit, drafted_held=beside.held)


def something_is_left(state: State) -> bool:
    """True if the answer with its drafts leaves more than white noise.

    What they leave nothing for, an effect cannot stand for: those beside the drafts are there.
    """
    return not state.hypotheses.is_noise(state.drafted or state.fit)


@a_pass
def examine_remainder(state: State) -> State:
    """The tests of what is left: noise, of whatever size and memory, or something unexplained."""
    hypotheses, fit = state.hypotheses, state.fit
    if state.drafted is not None:
        return replace(state, remainder=_described_by_drafts(hypotheses, fit, state.drafted))
    remainder = examine(hypotheses.residuals, fit.residual, len(fit.order))
    if not remainder.significant:
        wild = sum(int(s.wild.sum()) for s in hypotheses.residuals.data if s.wild is not None)
        if wild:
            remainder = replace(remainder, description=f"wild samples: {wild}", variable="sensor")
        return replace(state, remainder=remainder)
    note = as_noise(hypotheses.residuals, hypotheses.evidence.noise, fit.residual, remainder)
    if note is None:
        return replace(state, remainder=remainder)
    return replace(state, remainder=replace(remainder, significant=False, note=note))


def _described_by_drafts(hypotheses: Hypotheses, fit: Fit, drafted: Fit) -> Remainder:
    """Remainder of `fit`, described as a function of the main draft's variable, and of the drafts.

    A shape of another variable is no description: the draft explains what looks like that as well.
    """
    variable = _main_law(hypotheses, drafted).of
    remainder = examine(hypotheses.residuals, fit.residual, len(fit.order), variable)
    described = remainder.description if remainder.variable == variable else f"a law of {variable}"
    in_turn = examine(hypotheses.residuals, drafted.residual, len(drafted.order))
    return replace(
        remainder, significant=True, description=described, variable=variable, only_size=False,
        beside_drafts=None if hypotheses.leaves_noise(drafted) else in_turn.description,
    )  # fmt: skip


def _main_law(hypotheses: Hypotheses, drafted: Fit) -> Law:
    """The free-form term that explains most."""
    laws = {c.name: c.law for c in drafted.candidates if c.law}
    return laws[max(laws, key=lambda name: (hypotheses.without(drafted, name).rss, name))]
