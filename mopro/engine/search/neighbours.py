"""Sets of effects near a fitted one: some of its effects dropped, others added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

from mopro.engine.assumed import (
    FEWEST,
    FITTED,
    LEAST_SHARE,
    LINEARITY_ERROR,
    MAJORITY,
    MOST_EFFECTS,
    SECOND_GUESSES,
)
from mopro.engine.candidate import Candidate, Role
from mopro.engine.fits import Fit
from mopro.engine.search.hypotheses import Hypotheses, Proposal
from mopro.engine.search.linear_subset import LinearSubset
from mopro.engine.search.screening import Screening
from mopro.engine.series import Settings


@dataclass(frozen=True)
class Neighbourhood:
    """Sets that differ from `fit` by few effects, the lowest predicted EBIC first."""

    fit: Fit
    subsets: tuple[LinearSubset, ...]

    def with_laws(self) -> Neighbourhood:
        """Only the sets with a free-form term."""
        drafted = (s for s in self.subsets if any(c.law for c in s.candidates))
        return Neighbourhood(self.fit, tuple(drafted))


def neighbourhood(hypotheses: Hypotheses, screening: Screening, fit: Fit) -> Neighbourhood:
    """Sets near `fit` in the linear approximation, which needs few simulations.

    None, one, or all of its effects are dropped, of sets of two or three also two. As many are
    added as were dropped (two at most) and `_more`.
    """
    subsets: list[LinearSubset] = []
    bases = list(_reduced(hypotheses, fit))
    for reduced, dropped in bases:
        room = min(min(dropped, 2) + _more(reduced, fit), MOST_EFFECTS - len(reduced.candidates))
        closer = [base.key for base, _ in bases if reduced.key < base.key]
        found = screening.subsets(reduced, fit, room)
        subsets += [s for s in found if not any(key <= s.key for key in closer)]
    return Neighbourhood(fit, tuple(sorted(subsets, key=lambda subset: subset.ebic)))


def _more(reduced: Fit, fit: Fit) -> int:
    """Effects that may be added beyond those that were dropped from `fit`.

    Three to the null model, two where none was dropped, one where some were; far from linear
    one, two and none.
    """
    if reduced.far_from_linear:
        return 0 if reduced is not fit else SECOND_GUESSES if fit.candidates else 1
    if reduced is not fit:
        return 1
    return SECOND_GUESSES if fit.candidates else SECOND_GUESSES + 1


def _reduced(hypotheses: Hypotheses, fit: Fit) -> Iterator[tuple[Fit, int]]:
    """`fit` without none, one, two or all of its effects, and how many were dropped.

    The others are fitted again. If they leave a tenth less then, they have absorbed what was
    dropped, and are taken as they are, with what is left once they adapt, to first order: what
    takes the place of an effect lets them be. From where they have gone to make up for it, no
    signature leads back.
    """
    yield fit, 0
    every = len(fit.candidates)
    # Of larger sets there would be many pairs.
    several = [2] if 2 <= every <= FEWEST else []
    for number in (*([1] if every else []), *several, *([every] if every > 2 else [])):
        for names in combinations(sorted(fit.names), number):
            reduced = fit
            for name in names:
                reduced = hypotheses.without(reduced, name)
            if reduced.candidates:
                switched = hypotheses.switched_off(fit, frozenset(names))
                if reduced.rss < (1 - LEAST_SHARE) * switched.rss:
                    reduced = replace(switched, residual=switched.adapted)
            yield reduced, number


def in_other_forms(hypotheses: Hypotheses, fit: Fit) -> list[Proposal]:
    """`fit` with one of its effects in a form of more or fewer free parameters.

    Also with the special case of an effect, or a number of the model, in place of it.
    """
    return [
        proposal
        for candidate in fit.candidates
        for form in _neighbouring_forms(candidate, hypotheses.catalogue)
        if form.name not in fit.names - {candidate.name}
        for proposal in _in_another_form(fit, candidate, form)
    ]


def in_wider_forms(hypotheses: Hypotheses, near: Neighbourhood) -> list[Proposal]:
    """Single substitutes for one effect of `near.fit`, in the forms that extend them.

    Those that by themselves bring at least half of what the effect brings: a number that the
    plain form takes for granted may keep it from the rest.
    """
    proposals: list[Proposal] = []
    for subset in sorted(near.subsets, key=lambda s: -s.reduction):
        base = subset.base
        single = len(subset.members) == 1 and len(base.candidates) == len(near.fit.candidates) - 1
        if not single or subset.reduction < MAJORITY * (base.rss - near.fit.rss):
            continue
        (member,) = subset.members
        proposals += [
            (
                (*base.candidates, form),
                [{**subset.start, **in_form(form, subset.start[form.name])}],
            )
            for form in _neighbouring_forms(member.candidate, hypotheses.catalogue)
            if form.name == member.candidate.name and form.name not in near.fit.names
        ]
    return proposals[:FITTED]


def with_rivals(hypotheses: Hypotheses, fit: Fit) -> list[Proposal]:
    """`fit` with the effect that explains most of it replaced by others that do so as well.

    Each at the size at which it was fitted by itself: the signature of a strong effect does not
    predict what it brings there.
    """
    null = hypotheses.null
    alone: dict[str, Fit] = {}
    for other in hypotheses.ranked():
        if len(other.candidates) == 1:
            alone.setdefault(other.candidates[0].name, other)
    strongest = min(fit.names & alone.keys(), key=lambda n: (alone[n].rss, n), default=None)
    if strongest is None or not null.far_from_linear:
        return []
    explained = null.rss - alone[strongest].rss
    if explained < MAJORITY * (null.rss - fit.rss):
        return []
    limit = alone[strongest].rss + LINEARITY_ERROR * explained
    rivals = [f for f in alone.values() if not f.names & fit.names and f.rss < limit]
    kept = [c for c in fit.candidates if c.name != strongest]
    others = fit.settings_without(frozenset({strongest}))
    return [
        ((*kept, *rival.candidates), [{**others, **rival.settings}]) for rival in rivals[:FITTED]
    ]


def _in_another_form(fit: Fit, candidate: Candidate, form: Candidate) -> Iterator[Proposal]:
    """The set with an effect in another form, from each of its starts: each is fitted."""
    others = [c for c in fit.candidates if c is not candidate]
    left = fit.settings_without(frozenset({candidate.name}))
    known = fit.settings[candidate.name]
    for start in (in_form(form, known), *_from_plain(form, known)):
        yield (*others, form), [{**left, **start}]


def _from_plain(form: Candidate, known: Mapping[str, float]) -> Iterator[Settings]:
    """A wider form as the plain one with these numbers is, at each start of the further shapes.

    From there it ends no higher than that one. Where a motion sticks, sizes from their own starts
    may never come back.
    """
    further = [p for p in form.parameters if p.name not in known]
    shapes = [p for p in further if p.role is Role.SHAPE and p.starts]
    if not shapes or all(p.role is not Role.AMPLITUDE for p in further):
        return
    plain = {p.name: p.null for p in further} | dict(known)
    for values in product(*(p.starts for p in shapes)):
        yield form.settings(plain | {p.name: v for p, v in zip(shapes, values, strict=True)})


def in_form(form: Candidate, known: Mapping[str, float]) -> Settings:
    """Settings of a form: values of its parameters that are `known`, else its first starts."""
    values = {p.name: p.null for p in form.parameters}
    start = {**values, **{p.name: p.starts[0] for p in form.parameters if p.starts}}
    return form.settings(start | {n: v for n, v in known.items() if n in start})


def _neighbouring_forms(candidate: Candidate, catalogue: Sequence[Candidate]) -> list[Candidate]:
    """The forms that extend a candidate or are nested with it, those of its special case, and
    numbers of the model, which may be off within their tolerance.
    """
    return [
        form
        for form in catalogue
        if (form.name, form.extends) == candidate.key
        or form.nests(candidate)
        or candidate.nests(form)
        or form.name == candidate.special
        or (form.calibrates and not (candidate.calibrates or candidate.law))
    ]
