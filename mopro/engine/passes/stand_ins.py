"""Stand-ins: listed effects that resemble what nobody listed, and what gives them away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import linalg

from mopro.engine.assumed import FEWEST, MAJORITY, MOST_FOLDS, ROUNDING, VERY_STRONG
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.fits import Fit, parts_of, spread
from mopro.engine.passes.loops import a_pass
from mopro.engine.residuals import projected_out
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.series import Mask
from mopro.engine.state import State
from mopro.engine.verdict import Rejected

_STANDS_IN = "it stands in for something else"
_SPREAD = "its size differs from part to part by {:.0%}: " + _STANDS_IN
_AT_ITS_END = "its size, or its period, ends at the end of its range: " + _STANDS_IN
_MOVED = "its part changes by {:.0%} beside the free-form terms: " + _STANDS_IN
_RESHAPED = "as a function of {}, what is there has another shape: " + _STANDS_IN

# Parts whose sizes are compared, at the most. An effect that stands in for another one may have the
# right size on the average of a few moves. Halved, moves of different size are told as one.
_MOST_PARTS = FEWEST * MOST_FOLDS


@a_pass
def expose_stand_ins(state: State) -> State:
    """The answer without effects whose size differs from part to part, the worst dropped first.

    Also without those whose size the data would push out of its range. Either resembles something
    that nobody listed. The free-form term that describes most of what is left takes its place.
    """
    hypotheses = state.hypotheses
    parts = parts_of(hypotheses.residuals, _MOST_PARTS)
    while not hypotheses.is_noise(state.fit):
        reasons = _of_several_sizes(hypotheses, parts, state.fit)
        for name in _at_their_ends(hypotheses, state.fit) - reasons.keys():
            reasons[name] = 0.0, _AT_ITS_END
        if not reasons:
            break
        worst = max(sorted(reasons), key=lambda name: reasons[name][0])
        without = _taken_over(state, state.fit, worst)
        state = replace(_exposed(state, worst, reasons[worst][1]), fit=without)
    return state


def _exposed(state: State, name: str, reason: str) -> State:
    """The state with an effect of its answer known for a stand-in, the answer as it was."""
    gain = state.hypotheses.without(state.fit, name).rss - state.fit.rss
    rejected = (*state.rejected, Rejected(name, gain, reason))
    return replace(state, rejected=rejected, stand_ins=state.stand_ins | {name})


def _of_several_sizes(
    hypotheses: Hypotheses, parts: Sequence[Mask], fit: Fit
) -> dict[str, tuple[float, str]]:
    """Listed effects of `fit` whose size differs among the parts, by how much, and the reason."""
    answer = {}
    unexplained = 0.0 if hypotheses.leaves_noise(fit) else _beyond_noise(hypotheses, fit)
    for candidate in fit.candidates:
        if candidate.law or hypotheses.evidence.calibrated(fit, candidate):
            continue
        name = candidate.name
        own = spread(hypotheses.residuals, hypotheses.evidence.noise, parts, fit, name, unexplained)
        if own is not None and own.of_a_stand_in:
            answer[name] = own.share, _SPREAD.format(own.share)
    return answer


def _beyond_noise(hypotheses: Hypotheses, fit: Fit) -> float:
    """Sum of squares that `fit` leaves beyond the noise; the whole of it if that is no more."""
    beyond = fit.rss - hypotheses.noise_rss(fit)
    return beyond if beyond > 0 else fit.rss


def _at_their_ends(hypotheses: Hypotheses, fit: Fit) -> set[str]:
    """Listed effects whose size the data would push beyond the largest that it may be.

    Also flexible ones whose shape is the one at which their range ends.
    """
    bounds = set(hypotheses.evidence.at_bound(fit))

    def tells(c: Candidate, p: Parameter) -> bool:
        if p.role is not Role.AMPLITUDE:
            return c.flexible and p.role is Role.SHAPE
        return p.plausible is not None and p.beyond(fit.settings[c.name][p.name]) > 0

    return {
        c.name
        for c in fit.candidates
        for p in c.parameters
        if not c.law and f"{c.name}.{p.name}" in bounds and tells(c, p)
    }


@a_pass
def expose_beside_drafts(state: State) -> State:
    """The answer without effects that the drafts show to be something else, the worst first.

    An effect that is present has the same size whether or not the rest is fitted beside it, and
    its law has the form that somebody listed. What is in one run alone stands beside both.
    Calibrations, which name nothing, stay.
    """
    hypotheses = state.hypotheses
    while state.drafted is not None:
        listed = [
            c.name for c in state.fit.candidates if not hypotheses.evidence.calibrated(state.fit, c)
        ]
        beside = hypotheses.beside_single_runs(state.fit, state.drafted)
        reasons = _moved(hypotheses, beside, state.drafted, listed) or _reshaped(
            state, state.drafted, listed
        )
        if not reasons:
            break
        worst = max(sorted(reasons), key=lambda name: reasons[name][0])
        state = replace(
            _exposed(state, worst, reasons[worst][1]),
            fit=hypotheses.settled(hypotheses.without(state.fit, worst)),
            drafted=_taken_over(state, state.drafted, worst),
            drafted_held=None,
        )
    return state


def _moved(
    hypotheses: Hypotheses, fit: Fit, drafted: Fit, listed: Sequence[str]
) -> dict[str, tuple[float, str]]:
    """Effects whose part of the prediction is mostly another in `drafted`, and by how much.

    Where nothing is left, mostly lost: what describes the rest may only have uncovered more of it.
    """
    answer = {}
    whole = hypotheses.is_noise(drafted)
    for name in sorted(drafted.names.intersection(listed)):
        # Changes of the whitened residual (samples): by switching it off, and by its other size.
        part = hypotheses.switched_off(fit, frozenset({name})).residual - fit.residual
        moved = (
            hypotheses.residuals.at({**fit.settings, name: drafted.settings[name]}) - fit.residual
        )
        size = float(np.linalg.norm(part)) or np.inf
        change = float(np.linalg.norm(moved)) / size
        if (float(moved @ part) / size**2 if whole else change) > MAJORITY:
            answer[name] = change, _MOVED.format(change)
    return answer


def _reshaped(state: State, drafted: Fit, listed: Sequence[str]) -> dict[str, tuple[float, str]]:
    """Effects that are one form of a law of which a draft is another, and 0 for each.

    The law is all terms that enter where the draft does and are functions of the same variable. One
    of them does what the effect does, or in place of the effect they explain the data as well.
    """
    answer = {}
    fixed = [c.law for c in drafted.candidates if c.law and c.find_starts is None]
    drafts = [law for law in fixed if law.alone]
    for enters, of in sorted({(law.enters, law.of) for law in drafts}):
        terms = _terms(state, enters, of)
        for name, form in sorted(c.key for c in drafted.candidates if c.name in listed):
            if state.terms.get((name, form)) in terms or _freed(state, drafted, name, terms):
                answer[name] = 0.0, _RESHAPED.format(of)
    return answer


def _terms(state: State, enters: str, of: str) -> list[Candidate]:
    """The free-form terms of one place and variable, those that repeat listed effects included."""
    known = {c.name: c for c in (*state.hypotheses.catalogue, *state.terms.values()) if c.law}
    return [
        term
        for term in known.values()
        if term.law
        and (term.law.enters, term.law.of) == (enters, of)
        and not term.find_starts
        and term.law.alone
    ]


def _freed(state: State, drafted: Fit, name: str, terms: Sequence[Candidate]) -> bool:
    """True if `terms` in place of an effect of `drafted` explain as much, and most of its response.

    Its response to first order: a friction that goes altogether lets a motor ring.
    """
    noise = state.hypotheses.evidence.noise
    freed = _in_place_of(state, drafted, name, terms)
    if noise.deviance(freed.residual) - noise.deviance(drafted.residual) > VERY_STRONG:
        return False
    names = {term.name for term in terms}
    own = np.array([effect in names for effect, _ in freed.order], dtype=bool)
    columns = freed.jacobian[:, own]
    norms = np.linalg.norm(columns, axis=0)
    part = drafted.linear_part(name)
    left = projected_out(linalg.orth(columns / np.where(norms > 0, norms, 1.0), ROUNDING), part)
    return float(left @ left) < MAJORITY * float(part @ part)


def _in_place_of(state: State, drafted: Fit, name: str, terms: Sequence[Candidate]) -> Fit:
    """`drafted` with each of `terms` that it has not in place of an effect, the best one first.

    The others begin as they are: without the effect they would go far to make up for it.
    """
    fit = state.hypotheses.switched_off(drafted, frozenset({name}))
    missing = [term for term in terms if term.name not in fit.names]
    while missing:
        score = state.screening.of(fit, missing)[0]
        if not score.starts:
            break
        start = {**fit.settings, **score.starts[0]}
        fit = state.hypotheses.fitted((*fit.candidates, score.candidate), start)
        missing.remove(score.candidate)
    return state.hypotheses.settled(fit)


def _taken_over(state: State, fit: Fit, name: str) -> Fit:
    """`fit` without an effect, and with the free-form term that best describes what it stood for.

    No term is added unless one takes away most of what is left beyond noise. Where a term does
    what the effect does, it also begins beside the others as they are.
    """
    hypotheses = state.hypotheses
    without = hypotheses.settled(hypotheses.without(fit, name))
    terms = [c for c in hypotheses.catalogue if c.law and c.name not in without.names]
    same = [state.terms[c.key] for c in fit.candidates if c.name == name and c.key in state.terms]
    switched = hypotheses.switched_off(fit, frozenset({name}))
    fits = [without]
    for base, candidates in ((without, [*terms, *same]), (switched, same)):
        best = next((s for s in state.screening.of(base, candidates) if s.starts), None)
        if best is not None:
            start = {**base.settings, **best.starts[0]}
            fits.append(
                hypotheses.settled(hypotheses.fitted((*base.candidates, best.candidate), start))
            )
    described = min(fits, key=lambda f: f.rss)
    most = MAJORITY * _beyond_noise(hypotheses, without)
    return described if without.rss - described.rss > most else without
