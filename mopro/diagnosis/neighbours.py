"""Sets of effects near a fitted one: some of its effects dropped, others added."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.hypotheses import Hypotheses, Proposal
from mopro.diagnosis.linear_subset import LinearSubset, LinearSubsets
from mopro.diagnosis.model import Candidate
from mopro.diagnosis.screening import Screening, far_from_linear

# Effects in one set. Doubled, harmonics of many lines are told, and pure noise costs no more.
MOST_EFFECTS = 6
# Effects dropped at once, and added beyond those that were dropped. Doubled, the search leaves
# deeper minima and takes twice as long.
_MOST_DROPPED = 2
_MOST_MORE = 2
# Share of the sum of squares with an effect switched off, below which the others have absorbed it
# when they are fitted again: a search for starts must then look at the residual before that.
_ABSORBED = 0.8


@dataclass(frozen=True)
class Neighbourhood:
    """Sets that differ from `fit` by few effects, the lowest predicted EBIC first."""

    fit: Fit
    subsets: tuple[LinearSubset, ...]


def neighbourhood(sets: Hypotheses, screening: Screening, fit: Fit) -> Neighbourhood:
    """Sets near `fit` in the linear approximation, which needs few simulations.

    Up to two effects are dropped and up to two more than that are added; far from linear, one
    more than were dropped.
    """
    subsets: list[LinearSubset] = []
    for reduced, unabsorbed, dropped in _reduced(sets, fit):
        scores = screening.beside(reduced, fit, unabsorbed)
        room = min(
            min(dropped, _MOST_DROPPED) + _more(reduced, fit),
            MOST_EFFECTS - len(reduced.candidates),
        )
        subsets += LinearSubsets(reduced, scores, sets.evidence).best(room)
    return Neighbourhood(fit, tuple(sorted(subsets, key=lambda subset: subset.ebic)))


def _more(reduced: Fit, fit: Fit) -> int:
    """Effects that may be added beyond those that were dropped from `fit`."""
    if far_from_linear(reduced):
        return 0 if reduced is not fit else _MOST_MORE if fit.candidates else 1
    if reduced is not fit:
        return 1
    return _MOST_MORE if fit.candidates else _MOST_MORE + 1


def _reduced(sets: Hypotheses, fit: Fit) -> Iterator[tuple[Fit, Fit | None, int]]:
    """`fit` without none, one, two or all of its effects, and how many were dropped.

    The second is the fit with those effects switched off and the others as they are, if the
    others have absorbed them: if they leave less than 4/5 of that when they are fitted again.
    """
    yield fit, None, 0
    every = len(fit.candidates)
    for number in (*range(1, min(_MOST_DROPPED, every) + 1), *([every] if every > 2 else [])):
        for names in combinations(sorted(fit.names), number):
            reduced = fit
            for name in names:
                reduced = sets.without(reduced, name)
            switched = sets.switched_off(fit, frozenset(names)) if reduced.candidates else reduced
            absorbed = reduced.rss < _ABSORBED * switched.rss
            yield reduced, switched if absorbed else None, number


def in_other_forms(sets: Hypotheses, fit: Fit) -> list[Proposal]:
    """`fit` with one of its effects in a form of more or fewer free parameters."""
    return [
        _in_another_form(fit, form)
        for candidate in fit.candidates
        for form in _neighbouring_forms(candidate, sets.catalogue)
    ]


def _in_another_form(fit: Fit, form: Candidate) -> Proposal:
    others = [c for c in fit.candidates if c.name != form.name]
    values = {p.name: p.null for p in form.parameters}
    start = {**values, **{p.name: p.starts[0] for p in form.parameters if p.starts}}
    own = {n: v for n, v in fit.settings[form.name].items() if n in start}
    return (*others, form), {**fit.settings, **form.settings(start | own)}


def _neighbouring_forms(candidate: Candidate, catalogue: Sequence[Candidate]) -> list[Candidate]:
    """The forms that extend a candidate, and those nested with one that extends another."""
    return [
        form
        for form in catalogue
        if (form.name, form.extends) == candidate.key
        or (candidate.extends is not None and (form.nests(candidate) or candidate.nests(form)))
    ]
