"""Search for the set of effects of the lowest EBIC: neighbours of the best sets, until none helps.

One round takes the best set that was not yet expanded, predicts all sets near it from the Gram
matrix of signatures, fits the best of them, and judges all sets again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from mopro.engine.assumed import (
    FITTED,
    ITERATIONS,
    LINEARITY_ERROR,
    MAJORITY,
    OUT_OF_REACH,
    SAME,
    SECOND_GUESSES,
    VERY_STRONG,
)
from mopro.engine.candidate import Candidate, Role
from mopro.engine.fits import NO_LIMIT, Fit, Identity, Limit
from mopro.engine.search.hypotheses import Hypotheses, Proposal
from mopro.engine.search.linear_subset import LinearSubset, of_each_kind
from mopro.engine.search.neighbours import (
    Neighbourhood,
    in_other_forms,
    in_wider_forms,
    neighbourhood,
    with_rivals,
)
from mopro.engine.search.screening import Screening

# Rounds of a search before free-form terms join it: what nobody listed is described by several
# effects, which takes long.
FIRST_ROUNDS = 1


def search(
    hypotheses: Hypotheses,
    screening: Screening,
    also: Sequence[Fit] = (),
    rounds: int = SECOND_GUESSES,
    only_laws: bool = False,
) -> None:
    """Fit sets of effects to `sets` until none near the best one has a lower EBIC.

    Begins with the null model and the sets in `also`. After so many `rounds` it ends unless
    the best set leaves noise, or less than half of what those expanded so far leave. Of unknown
    noise that half may be all. Another set that leaves less than half of what the best and those
    leave is expanded in any case: several slow effects together may show that what each of them
    leaves is no noise with a memory.
    `only_laws`: the listed effects have been searched, and only sets with a free-form term are
    fitted.
    """
    expanded: set[Identity] = set()
    others, least = 0, math.inf
    for start in (hypotheses.null, *also):
        if start.identity not in expanded:
            expanded.add(start.identity)
            least = min(least, start.rss)
            _round(hypotheses, screening, start, only_laws)
    for number in range(ITERATIONS):
        best, fullest = hypotheses.best(), hypotheses.fullest()
        leads_on = hypotheses.residuals.known_noise and best.rss < MAJORITY * least
        last = ITERATIONS if leads_on else rounds
        front: Fit | None
        if fullest.rss < MAJORITY * min(least, best.rss):
            front = fullest
        elif _is_known(hypotheses, best, expanded) if hypotheses.is_noise(best) else number >= last:
            break
        else:
            front = best if best.identity not in expanded else _next(hypotheses, best, expanded)
            if front is None:
                break
            if front is not best:
                others += 1
                if others > SECOND_GUESSES:
                    break
        expanded.add(front.identity)
        least = min(least, front.rss)
        _round(hypotheses, screening, front, only_laws)
        others = 0 if hypotheses.best() is not best else others


def join_singly(hypotheses: Hypotheses, screening: Screening) -> None:
    """Fit the best set with each other listed effect beside it, until none lowers the EBIC.

    What the free numbers of a model make up for has next to no signature beside them, and is
    found by a fit alone.
    """
    if not hypotheses.base:
        return
    while not hypotheses.is_noise(best := hypotheses.best()):
        scores = screening.of(best, [c for c in screening.joining(best) if not c.law])
        proposals = [
            (
                (*best.candidates, s.candidate),
                [{**best.settings, **s.starts[0]}],
            )
            for s in scores
            if s.starts
        ]
        hypotheses.fit_all(proposals, hypotheses.limit(best))
        hypotheses.judge_by(hypotheses.fullest())
        if hypotheses.best().key == best.key:
            break


def _is_known(hypotheses: Hypotheses, best: Fit, expanded: set[Identity]) -> bool:
    """True if the best set was expanded, or another that leaves the same noise: a tie."""
    limit = hypotheses.ebic(best) + SAME
    return any(
        fit.identity in expanded and hypotheses.ebic(fit) <= limit for fit in hypotheses.ranked()
    )


def _next(hypotheses: Hypotheses, best: Fit, expanded: set[Identity]) -> Fit | None:
    """The next best set that was not expanded and explains the data otherwise."""
    limit = max(hypotheses.limit(best).most, LINEARITY_ERROR * hypotheses.null.rss)
    for fit in hypotheses.ranked():
        if fit.rss < limit and fit.candidates and fit.identity not in expanded:
            return fit
    return None


def _round(hypotheses: Hypotheses, screening: Screening, front: Fit, only_laws: bool) -> None:
    """Fit the sets near `front` that may lower the EBIC, and the best one in other forms."""
    before = hypotheses.best()
    near = neighbourhood(hypotheses, screening, front)
    if only_laws:
        near = near.with_laws()
    proposed = _proposed(hypotheses, near)
    reachable = hypotheses.limit(before) if hypotheses.is_noise(before) else NO_LIMIT
    hypotheses.fit_all(_proposals(proposed[:SECOND_GUESSES]), reachable)
    # Of those that follow, none is of use that leaves more than these, if they leave noise.
    hypotheses.judge_by(hypotheses.fullest())
    limit = hypotheses.limit(hypotheses.best())
    if hypotheses.null.far_from_linear and not hypotheses.is_noise(hypotheses.best()):
        # What is predicted badly may be expanded next; where the best set leaves noise, nothing is.
        limit = Limit(max(limit.most, LINEARITY_ERROR * hypotheses.null.rss))
    others = [
        *in_wider_forms(hypotheses, near),
        *([] if only_laws else with_rivals(hypotheses, front)),
    ]
    hypotheses.fit_all([*_proposals(proposed[SECOND_GUESSES:]), *others], limit)
    hypotheses.judge_by(hypotheses.fullest())
    best = hypotheses.best()
    while best is not before:
        before = best
        for fit in _in_reach(hypotheses, best):
            _fit_forms(hypotheses, fit)
        # Another form may leave less than any set did, and less noise with a memory.
        hypotheses.judge_by(hypotheses.fullest())
        best = hypotheses.best()
    for fit in _in_reach(hypotheses, best):
        _fit_parts(hypotheses, fit)
    best = hypotheses.best()
    if not hypotheses.is_noise(best):
        # A fit that ended in a narrow valley calls for effects that are not there.
        hypotheses.settled(best)


def _in_reach(hypotheses: Hypotheses, best: Fit) -> list[Fit]:
    """The best set, and those of no more effects that come below it in another form or without one.

    An effect in its plainest form may lose to one that has a number more.
    """
    limit = hypotheses.ebic(best) + OUT_OF_REACH
    others = [
        fit
        for fit in hypotheses.ranked()
        if fit is not best
        and fit.names != best.names
        and len(fit.candidates) <= len(best.candidates)
        and hypotheses.ebic(fit) < limit
    ]
    return [best, *others[:SECOND_GUESSES]]


def _fit_forms(hypotheses: Hypotheses, fit: Fit) -> None:
    """Fit `fit` in other forms, and each of those that come near without one of its effects.

    A form of fewer free numbers is given up where it cannot do as well by what they cost.
    """
    evidence = hypotheses.evidence
    # Another form may make an effect superfluous, which saves the penalty of that.
    saved = max((evidence.added_penalty(hypotheses.null, [c]) for c in fit.candidates), default=0.0)
    deviance = evidence.noise.deviance
    wide = Limit.of_deviance(hypotheses.ebic(fit) + saved, evidence.noise)

    def limit(candidates: Sequence[Candidate]) -> Limit:
        if not _narrower(candidates, fit):
            return wide
        penalty = evidence.of_joining(candidates, fit.count, 0)
        return Limit.of_deviance(hypotheses.ebic(fit) + VERY_STRONG - penalty, evidence.noise)

    for trial in hypotheses.fit_all(in_other_forms(hypotheses, fit), limit):
        # What the form has more is at its null there, where the fit needs it for nothing yet.
        room = deviance(fit.residual) + saved - deviance(trial.residual)
        if trial.abandoned or room <= 0:
            continue
        for name in sorted(trial.names):
            rise = deviance(trial.residual_without(name)) - deviance(trial.residual)
            # One that is predicted to explain more than twice of that is not superfluous.
            if hypotheses.null.far_from_linear or MAJORITY * rise < room:
                hypotheses.without(trial, name, wide)


def _narrower(candidates: Sequence[Candidate], fit: Fit) -> bool:
    """True if the set is that of `fit` with some of its free numbers fixed."""
    return any(own.nests(other) for own in fit.candidates for other in candidates)


def _fit_parts(hypotheses: Hypotheses, fit: Fit) -> None:
    """Fit `fit` without each effect that it hardly needs, where that may bring it below the best.

    An effect that another one takes the place of may have made up for what it lacked. What one is
    needed for is told by the fit's Jacobian, so of those that have a size only.
    """
    evidence, best = hypotheses.evidence, hypotheses.best()
    deviance, above = evidence.noise.deviance, hypotheses.ebic(fit) - hypotheses.ebic(best)
    others = max(evidence.findings(fit) - 1, 0)
    for candidate in sorted(fit.candidates, key=lambda c: c.key):
        has_size = any(p.role is Role.AMPLITUDE for p in candidate.parameters)
        if len(fit.candidates) == 1 or not has_size:
            continue
        rise = deviance(fit.residual_without(candidate.name)) - deviance(fit.residual)
        if above + rise < evidence.of_joining([candidate], fit.count, others):
            hypotheses.without(fit, candidate.name, hypotheses.limit(best))


def _proposals(subsets: Sequence[LinearSubset]) -> list[Proposal]:
    return [(subset.candidates, subset.starts) for subset in subsets]


def _proposed(hypotheses: Hypotheses, near: Neighbourhood) -> list[LinearSubset]:
    """The sets to fit: those of the lowest predicted EBIC that may be below that of the best.

    Both EBICs are those for white noise; for noise with a memory the fit decides.

    Where a single effect is predicted to leave next to nothing only such are fitted, those that
    are predicted as well: a signature may misjudge a strong effect by more than a second one would
    gain. So are they where one of them explains more than the larger sets are predicted to.
    """
    best = hypotheses.best()
    limit = hypotheses.white.ebic(best)
    # A set that contains the best one is predicted better from that, or from a larger part.
    parts = [part for part in hypotheses.as_good(best) if not part <= near.fit.key]
    hopeful = [
        s
        for s in near.subsets
        if s.ebic - LINEARITY_ERROR * s.reduction < limit
        and not hypotheses.knows(s.candidates, s.ebic)
        and not any(part < s.key for part in parts)
    ]
    single = [s for s in near.subsets if len(s.members) == 1]
    if not near.fit.candidates and single and single[0].ebic < limit:
        first = single[0]
        error = LINEARITY_ERROR * first.reduction
        excess = near.fit.rss - near.fit.count * hypotheses.scale(near.fit)
        if excess - first.reduction <= error:
            return of_each_kind([s for s in single if s.ebic < first.ebic + error], FITTED)
    if not near.fit.candidates and single and _misled(hypotheses, near, single[0], hopeful):
        return of_each_kind(single, SECOND_GUESSES)
    chosen = of_each_kind(hopeful if hypotheses.is_noise(best) else _minimal(hopeful), FITTED)
    if near.fit.far_from_linear:
        chosen += of_each_kind([s for s in hopeful if len(s.members) == 1], 2 * FITTED)
    return list(dict.fromkeys([*chosen, *of_each_kind(_simpler(near), FITTED)]))


def _minimal(subsets: Sequence[LinearSubset]) -> list[LinearSubset]:
    """The subsets of which no part beside the same base is predicted to do as well.

    By what signatures misjudge a set, a member may seem needed. One that is joins the part in the
    next round.
    """

    def needed(s: LinearSubset) -> bool:
        limit = s.ebic + LINEARITY_ERROR * s.reduction
        parts = (part for part in subsets if part.base is s.base and part.ebic < limit)
        return not any(part.key < s.key for part in parts)

    return [s for s in subsets if needed(s)]


def _misled(
    hypotheses: Hypotheses,
    near: Neighbourhood,
    first: LinearSubset,
    hopeful: Sequence[LinearSubset],
) -> bool:
    """True if the likeliest single effect explains more than any larger set is predicted to.

    Beside a dry friction nothing is linear, and what joins it is predicted from its own fit.
    """
    larger = [s.reduction for s in hopeful if len(s.members) > 1]
    if not larger:
        return False
    fit = hypotheses.fitted(first.candidates, first.start)
    return near.fit.rss - fit.rss > max(larger)


def _simpler(near: Neighbourhood) -> list[LinearSubset]:
    """Single effects that may do for several of `near.fit`, the largest reduction first.

    A signature that was simulated at another size may predict half of what its effect brings.
    """
    single = [s for s in near.subsets if len(s.members) == 1]
    several = [s for s in single if len(s.base.candidates) < len(near.fit.candidates) - 1]
    able = [s for s in several if s.reduction > MAJORITY * (s.base.rss - near.fit.rss)]
    return sorted(able, key=lambda s: -s.reduction)
