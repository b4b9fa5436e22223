"""Passes that find what explains the data: searches of sets, and fits to their minimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mopro.engine.assumed import MAJORITY, VERY_STRONG
from mopro.engine.candidate import Candidate
from mopro.engine.fits import Fit
from mopro.engine.freeform import WithLaws, measurement_laws
from mopro.engine.passes.loops import a_pass
from mopro.engine.search.rounds import FIRST_ROUNDS, join_singly, search
from mopro.engine.state import State


@a_pass
def search_catalogue(state: State) -> State:
    """The set of listed effects of the lowest EBIC, as far as a few rounds lead.

    They begin with the answer so far as well, if there is one. Done once for the same model and
    data.
    """
    if state.searched:
        return state
    hypotheses, known = state.hypotheses, [state.fit] if state.fit.candidates else []
    search(hypotheses, state.screening, known, rounds=FIRST_ROUNDS)
    join_singly(hypotheses, state.screening)
    return replace(state, fit=hypotheses.best(), searched=True)


@a_pass
def add_laws(state: State) -> State:
    """The search continued with free-form terms beside the catalogue, where something is left.

    A set that needs several effects, or a flexible one, may stand for one that nobody listed. So
    may a single one in whose place a term of the measurement, which costs no simulation, is
    predicted to do as well, or beside which it is predicted to do better. Done once for the same
    model and data.
    """
    noise = state.hypotheses.is_noise(state.fit)
    if state.widened or (noise and not state.fit.candidates):
        return state
    state = replace(state, widened=True)
    problem = state.problem
    laws = measurement_laws(problem.data, complete=noise)
    hypotheses, terms = state.hypotheses, (*laws, *problem.unlisted)
    coarse = problem.coarse and WithLaws(problem.coarse, problem.data, laws)
    hypotheses.join(terms, WithLaws(problem.simulate, problem.data, laws), coarse)
    own = state.fit.candidates
    doubtful = len(own) > 1 or any(c.flexible or c.run is not None for c in own)
    if noise and not doubtful and not _rivalled(state, laws):
        hypotheses.leave_out({term.name for term in terms})
        return state
    repeated = [(term, state.screening.listed_like(term)) for term in terms]
    hypotheses.leave_out({term.name for term, listed in repeated if listed})
    state = replace(state, terms={key: term for term, listed in repeated for key in listed})
    # Several effects may make up for one that nobody listed beside a single one. Where they leave
    # noise, what may stand beside one of them is found from their own neighbourhood.
    single = next((fit for fit in hypotheses.ranked() if len(fit.candidates) == 1), state.fit)
    part = single.key <= state.fit.key
    fronts = [state.fit, *([] if part and noise else [single])]
    search(hypotheses, state.screening, fronts, only_laws=noise)
    if not hypotheses.best().laws and (law := _law_alone(state)) is not None:
        search(hypotheses, state.screening, [law], only_laws=True)
    best, listed = hypotheses.best(), hypotheses.best_listed()
    # What somebody has listed has the benefit of the doubt, if it is no more.
    doubt = 0.0 if len(best.candidates) < len(listed.candidates) else VERY_STRONG
    stays = hypotheses.ebic(listed) - hypotheses.ebic(best) < doubt
    return replace(state, fit=listed if stays else best)


def _law_alone(state: State) -> Fit | None:
    """The fit of a law of the model, alone, that explains most of what several listed effects do.

    A strong one is predicted badly beside anything: only a fit shows what it explains, and what may
    join it.
    """
    hypotheses, listed = state.hypotheses, state.hypotheses.best_listed()
    laws = [c for c in hypotheses.catalogue if c.law and not c.law.of_data]
    if len(listed.candidates) < 2 or not laws:
        return None
    scores = [s for s in state.screening.of(hypotheses.null, laws) if s.starts]
    fits = hypotheses.fit_all(
        [((s.candidate,), [{**hypotheses.null.settings, **s.starts[0]}]) for s in scores]
    )
    best = min(fits, key=lambda fit: fit.rss, default=hypotheses.null)
    most = MAJORITY * (hypotheses.null.rss - listed.rss)
    return best if hypotheses.null.rss - best.rss > most else None


def _rivalled(state: State, laws: Sequence[Candidate]) -> bool:
    """True if one of `laws` is predicted to do as well as the answer, or very well beside it."""
    hypotheses, screening, fit = state.hypotheses, state.screening, state.fit
    limit = hypotheses.white.ebic(fit)
    return any(
        screening.predicted_ebic(base, score) < limit + margin
        and not screening.listed_like(score.candidate)
        for base, margin in ((hypotheses.null, VERY_STRONG), (fit, -VERY_STRONG))
        for score in screening.of(base, laws, at=hypotheses.null)
    )


@a_pass
def settle(state: State) -> State:
    """The answer at its minimum; if something is left, also what it leaves without each effect.

    There fits end in narrow valleys.
    """
    hypotheses, fit = state.hypotheses, state.fit
    if not hypotheses.is_noise(fit):
        for name in sorted(fit.names):
            hypotheses.settled(hypotheses.without(fit, name))
    return replace(state, fit=hypotheses.settled(fit))
