"""Alternatives to a set of effects: other sets that explain the data as well."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy import special

from mopro.engine.assumed import (
    FALSE_ALARMS,
    FITTED,
    LEAST_SHARE,
    LINEARITY_ERROR,
    MAJORITY,
    STRONG,
    VERY_STRONG,
)
from mopro.engine.candidate import Candidate
from mopro.engine.fits import Fit, Identity, with_tolerances
from mopro.engine.residuals import projected_out
from mopro.engine.search.hypotheses import Hypotheses, Proposal
from mopro.engine.search.linear_subset import LinearSubset, of_each_kind
from mopro.engine.search.neighbours import in_form, in_other_forms, neighbourhood
from mopro.engine.search.screening import Screening
from mopro.engine.search.signature import ScoreTest
from mopro.engine.series import Settings

# Chi-squared explained below which an effect is so small that the error of its signature is less
# than what distinguishes two explanations.
_WEAK = VERY_STRONG / LINEARITY_ERROR


@dataclass(frozen=True)
class Alternative:
    """A set of effects that does as well: its EBIC above that of the best, and its settings.

    `laws`: those of its names that are free-form terms, which the settings leave out.
    """

    names: frozenset[str]
    delta_ebic: float
    settings: Settings
    laws: frozenset[str] = frozenset()

    @staticmethod
    def of(candidates: Iterable[Candidate], delta_ebic: float, settings: Settings) -> Alternative:
        names = frozenset(c.name for c in candidates)
        laws = frozenset(c.name for c in candidates if c.law)
        listed = {name: values for name, values in settings.items() if name not in laws}
        return Alternative(names, delta_ebic, listed, laws)


def alternatives(
    hypotheses: Hypotheses, screening: Screening, best: Fit
) -> tuple[Alternative, ...]:
    """The sets within 10 of the EBIC of `best`, the lowest first, one for each set of names.

    Each of their effects is needed, and no value gives very strong evidence against its plausible
    range that does not do so in `best`. Neither a part of `best` nor a set that contains it is an
    alternative.
    """
    weak: list[Alternative] = []
    subsets = [
        s for s in neighbourhood(hypotheses, screening, best).subsets if _differs(s.names, best)
    ]
    subsets.sort(key=lambda s: (sorted(s.base.key), s.ebic))
    for base, group in groupby(subsets, key=lambda s: s.base):
        own = list(group)
        _fit_likely(hypotheses, screening, best, base, own)
        if base.rss - best.rss < _WEAK:
            weak += _weak(hypotheses, best, own)
    for candidates, start in _exchanged(hypotheses, screening, best):
        hypotheses.fitted_from(candidates, start, hypotheses.limit(best))
    fitted = [
        Alternative.of(fit.candidates, hypotheses.evidence.above(fit, best), fit.settings)
        for fit in _each_fitted(hypotheses)
        if _is_alternative(hypotheses, fit, best)
    ]
    lowest: dict[frozenset[str], Alternative] = {}
    for other in sorted([*fitted, *weak], key=lambda a: (a.delta_ebic, sorted(a.names))):
        lowest.setdefault(other.names, other)
    return tuple(lowest.values())


def alike(hypotheses: Hypotheses, best: Fit) -> tuple[Alternative, ...]:
    """The fitted sets of listed effects that predict these data as `best` does, of no more numbers.

    The lowest EBIC first, one for each set of names. In no series do the predictions differ by more
    than a tenth of the noise, nor by more than a tenth of what the effects do that are exchanged.
    Long records tell less than that apart, but only of a model that is as exact.
    """
    lowest: dict[frozenset[str], Alternative] = {}
    for fit in hypotheses.ranked():
        if fit.names not in lowest and _is_alike(hypotheses, fit, best):
            delta = hypotheses.evidence.above(fit, best)
            lowest[fit.names] = Alternative.of(fit.candidates, delta, fit.settings)
    return tuple(lowest.values())


def _is_alike(hypotheses: Hypotheses, fit: Fit, best: Fit) -> bool:
    return (
        not fit.laws
        and fit.chosen <= best.chosen
        and _differs(fit.names, best)
        and hypotheses.evidence.implausible(fit) <= hypotheses.evidence.implausible(best)
        and _predicts_as(hypotheses, fit, best)
    )


def _predicts_as(hypotheses: Hypotheses, fit: Fit, best: Fit) -> bool:
    """True if the predictions differ by a tenth at the most: of the noise, of what differs."""
    split, without = hypotheses.residuals.split, best
    for name in sorted(best.names - fit.names):
        without = hypotheses.without(without, name)
    most = LEAST_SHARE**2 * max(without.rss - best.rss, 0.0)
    difference = fit.residual - best.residual
    loudness = hypotheses.scale(best)
    return float(difference @ difference) < most and all(
        float(np.mean(own**2)) < LEAST_SHARE**2 * loudness for own in split(difference)
    )


def _each_fitted(hypotheses: Hypotheses) -> Iterator[Fit]:
    """All fitted sets, also those that are fitted while the others are looked at."""
    known = set[Identity]()
    while new := [fit for fit in hypotheses.ranked() if fit.identity not in known]:
        known |= {fit.identity for fit in new}
        yield from new


def _differs(names: frozenset[str], best: Fit) -> bool:
    """True if a set of these names is neither a part of `best` nor contains it."""
    return bool(names - best.names and best.names - names)


def _fit_likely(
    hypotheses: Hypotheses,
    screening: Screening,
    best: Fit,
    base: Fit,
    subsets: Sequence[LinearSubset],
) -> None:
    """Fit the subsets beside `base` that may do as well as `best`."""
    reduction = base.rss - best.rss
    if reduction <= 0:
        return
    needed, known = _needed(hypotheses, screening, best, base), hypotheses.as_good(best)
    close = []
    for subset in subsets:
        if any(part < subset.key for part in known):
            continue
        reached = subset.reduction
        if reached < needed and len(subset.members) == 1:
            if reached < MAJORITY * needed:
                continue
            reached = screening.at_its_start(base, subset.members[0]).predicted_reduction
        if reached >= needed:
            close.append((subset.ebic + subset.reduction - reached, subset))
    close.sort(key=lambda pair: (len(pair[1].members), pair[0]))
    # Those of more members are predicted to reach more.
    by_size = groupby((subset for _, subset in close), key=lambda s: len(s.members))
    likely = [subset for _, group in by_size for subset in of_each_kind(group, FITTED)]
    limit = hypotheses.limit(best)
    proposals: list[Proposal] = [(s.candidates, s.starts) for s in likely]
    proposals += [wider for s in likely if (wider := _in_forms_of(hypotheses, best, s))]
    for fit in hypotheses.fit_all(_affordable(hypotheses, best, proposals), limit):
        if not fit.abandoned:
            hypotheses.fit_all(
                _affordable(hypotheses, best, in_other_forms(hypotheses, fit)), limit
            )


def _exchanged(
    hypotheses: Hypotheses, screening: Screening, best: Fit
) -> Iterator[tuple[list[Candidate], Settings]]:
    """Sets in which a number of the model replaces an effect of `best`, and where they begin.

    The number has a tolerance, and what `best` has fitted makes up for it to first order: both are
    one (a gain of the input, and the mass beside all forces). The start is where the step leads
    that turns the effect off, the numbers of single runs as they are: without the effect the
    others may have gone to another minimum.
    """
    shared = [i for i, (_, p) in enumerate(best.order) if p.run is None]
    for number in (c for c in screening.joining(best) if c.calibrates):
        beside = with_tolerances(hypotheses.residuals, best, [number])
        columns = beside.jacobian[:, len(best.order) :]
        left = projected_out(best.tangent, columns)
        if np.sum(left**2) >= (LINEARITY_ERROR / LEAST_SHARE) ** 2 * np.sum(columns**2):
            continue
        beside = replace(
            best,
            candidates=(*best.candidates, number),
            order=(*(best.order[i] for i in shared), *beside.order[len(best.order) :]),
            jacobian=np.column_stack([best.jacobian[:, shared], columns]),
            settings={
                **best.settings,
                **number.settings({p.name: p.null for p in number.parameters}),
            },
        )
        for name in sorted(best.names):
            others = [c for c in beside.candidates if c.name != name]
            yield others, beside.stepped_without(name)


def _affordable(hypotheses: Hypotheses, best: Fit, proposals: Sequence[Proposal]) -> list[Proposal]:
    """Those of the proposals that may come within the margin, by the penalty of their parameters.

    Beside an answer that leaves noise none explains strongly more, or the search had found it.
    """
    if not hypotheses.is_noise(best):
        return list(proposals)
    most = hypotheses.evidence.of_joining(best.candidates, best.count, 0) + VERY_STRONG + STRONG
    return [p for p in proposals if hypotheses.evidence.of_joining(p[0], best.count, 0) <= most]


def _in_forms_of(hypotheses: Hypotheses, best: Fit, subset: LinearSubset) -> Proposal | None:
    """The subset with its plain members in the forms of the effects of `best` that they replace.

    Its other numbers begin as they are in `best`: what such a form has fitted, and a plain one
    takes for granted, would keep that from doing as well. None if no member has such a form.
    """
    plain = {c.name: c for c in subset.candidates if not c.form}
    replaced = [c for c in best.candidates if c.form and c.key not in subset.key]
    wider, start = dict[str, Candidate](), dict(subset.start)
    for form in hypotheses.catalogue:
        same = next((c for c in replaced if c.form == form.form), None)
        if same is None or form.name not in plain:
            continue
        own = {p.name for p in plain[form.name].parameters}
        fitted = {n: v for n, v in best.settings[same.name].items() if n not in own}
        wider[form.name] = form
        start |= in_form(form, {**start[form.name], **fitted})
    return ([wider.get(c.name, c) for c in subset.candidates], [start]) if wider else None


def _needed(hypotheses: Hypotheses, screening: Screening, best: Fit, base: Fit) -> float:
    """Predicted reduction from which on a set beside `base` may do as well as `best`.

    Far from linear, signatures predict less for the effects themselves than they bring.
    """
    reduction = base.rss - best.rss
    dropped = best.names - base.names
    predicted = reduction
    if len(dropped) == 1:
        own = [s for s in screening.beside(base, best) if s.candidate.name in dropped]
        predicted = max((s.predicted_reduction for s in own), default=reduction)
    if reduction < _WEAK:
        return min(reduction, predicted) - VERY_STRONG
    error = min(LEAST_SHARE, LINEARITY_ERROR + 2 * abs(predicted / reduction - 1))
    margin = 4 * VERY_STRONG * _density(hypotheses, best, base)
    return min(reduction, predicted) - margin - error * reduction


def _density(hypotheses: Hypotheses, best: Fit, base: Fit) -> float:
    """Mean power of the noise where the effects that `base` lacks have theirs."""
    noise, change = hypotheses.evidence.noise, base.residual - best.residual
    size = float(change @ change)
    if noise.exact or not size:
        return 1.0
    return float(np.sum(noise.transformed(change[:, None]) ** 2)) / size


def _weak(hypotheses: Hypotheses, best: Fit, subsets: Iterable[LinearSubset]) -> list[Alternative]:
    """Single effects that do as well at the size that their signature asks for.

    A weak effect has many alternatives, nearly all of them linear: they are simulated once, and
    fitted only if they do not do as well there. What nobody listed is fitted, to tell how it is.
    """
    limit, evidence, answer = hypotheses.limit(best), hypotheses.evidence, list[Alternative]()
    for subset in subsets:
        close = subset.ebic < hypotheses.white.ebic(best) + VERY_STRONG
        if not close or len(subset.members) != 1 or not _plausible(subset.members[0]):
            continue
        joined = subset.members[0].candidate
        deviance = evidence.noise.deviance(hypotheses.residuals.at(subset.start))
        penalty = evidence.penalty(subset.base) + evidence.added_penalty(subset.base, [joined])
        delta = deviance + penalty - hypotheses.ebic(best)
        if delta < VERY_STRONG and not joined.law:
            answer.append(Alternative.of(subset.candidates, delta, subset.start))
        else:
            hypotheses.fitted(subset.candidates, subset.start, limit)
    return answer


def _plausible(score: ScoreTest) -> bool:
    """True if the size that the signature asks for is plausible, its error allowed for."""
    values = score.starts[0][score.candidate.name]
    error = math.sqrt(VERY_STRONG / max(score.predicted_reduction, 1.0))
    return not any(
        p.beyond(values[p.name]) > error * abs(values[p.name]) for p in score.candidate.parameters
    )


def _is_alternative(hypotheses: Hypotheses, fit: Fit, best: Fit) -> bool:
    return (
        hypotheses.evidence.above(fit, best) < VERY_STRONG
        and _differs(fit.names, best)
        and hypotheses.evidence.implausible(fit) <= hypotheses.evidence.implausible(best)
        and not _nests_prediction(hypotheses, fit, best)
        and not _in_other_words(hypotheses, fit)
        and all(_is_needed(hypotheses, fit, name, best) for name in fit.names)
    )


def _is_needed(hypotheses: Hypotheses, fit: Fit, name: str, best: Fit) -> bool:
    """True if there is strong evidence for an effect of `fit`, or no alternative without it."""
    without = hypotheses.without(fit, name, hypotheses.limit(best))
    strongly = hypotheses.ebic(without) > hypotheses.ebic(fit) + STRONG
    return strongly or hypotheses.evidence.above(without, best) >= VERY_STRONG


def _in_other_words(hypotheses: Hypotheses, fit: Fit) -> bool:
    """True if `fit` has a free-form term and predicts what listed effects, no more of them, do."""
    return bool(fit.laws) and any(
        len(other.candidates) <= len(fit.candidates) and _nests_prediction(hypotheses, fit, other)
        for other in hypotheses.ranked()
        if not other.laws
    )


def _nests_prediction(hypotheses: Hypotheses, wider: Fit, fit: Fit) -> bool:
    """True if `wider` has more parameters and predicts the same, as far as noise tells.

    It is then the same explanation with parameters to spare, and no alternative. A form of its own
    that was extended for its fit needs its parameters. Assumed constants do not count, as in the
    EBIC. A free-form term that predicts the same is a listed effect in other words, unless it has
    fewer parameters than a flexible effect, which may resemble what nobody listed.
    """
    extra = wider.chosen - fit.chosen
    flexible = any(c.flexible for c in fit.candidates if c.key not in wider.key)
    if wider.laws and not (flexible and extra < 0):
        extra = max(extra, 1)
    own = [c for c in wider.candidates if c.key not in fit.key]
    if extra <= 0 or any(c.extends and not c.can_enter_first for c in own):
        return False
    difference = wider.residual - fit.residual
    chi2 = float(np.sum(difference**2 / hypotheses.evidence.noise.variances(fit.residual)))
    return chi2 < float(special.chdtri(extra, FALSE_ALARMS))
