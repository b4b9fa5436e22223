"""The passes of the diagnosis: each a function from one state to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from mopro.engine.assumed import (
    FALSE_ALARMS,
    LEAST_SHARE,
    LINEARITY_ERROR,
    SAME,
    STRONG,
    TOLERANCE,
    VERY_STRONG,
)
from mopro.engine.candidate import Candidate, Law
from mopro.engine.fits import Fit, HeldOut, explained_by, held_out
from mopro.engine.freeform import WithLaws, measurement_laws
from mopro.engine.residuals import (
    Noise,
    Remainder,
    as_noise,
    difference_variance,
    examine,
    without_rough_ends,
    without_wild,
)
from mopro.engine.search.alternatives import Alternative, alternatives
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.neighbours import in_other_forms
from mopro.engine.search.rounds import FIRST_ROUNDS, join_singly, search
from mopro.engine.series import Floats, Series, Simulate
from mopro.engine.stand_ins import expose_beside_drafts, expose_stand_ins
from mopro.engine.state import State
from mopro.engine.verdict import Rejected

# Standard errors by which a variance must be below the stated one to replace it.
_STANDARD_ERRORS = -float(special.ndtri(FALSE_ALARMS / 2))

FAILS_HELD_OUT = "lowers chi-squared where it is fitted, and raises it where it is held out"
_NO_GAIN = "lowers the EBIC by less than a Bayes factor of 20 beside what remains"
_OUTWEIGHED = "explains less than what stays unexplained beside it"

Pass = Callable[[State], State]
# A series and its residual, in its unit: the series without some samples, and notes on those.
LeaveOut = Callable[[Series, Floats], tuple[Series, list[str]]]


def set_ends_aside(state: State) -> State:
    """Give no weight to the few samples beyond a jump of the readings near an end of a series.

    Before the search, as an effect may take the shape of such a jump.
    """
    return _left_out(state, state.sets.null, without_rough_ends)


def search_catalogue(state: State) -> State:
    """The set of listed effects of the lowest EBIC, as far as a few rounds lead.

    They begin with the answer so far as well, if there is one.
    """
    sets, known = state.sets, [state.fit] if state.fit.candidates else []
    search(sets, state.screening, known, rounds=FIRST_ROUNDS)
    join_singly(sets, state.screening)
    return replace(state, fit=sets.best())


def set_wild_aside(state: State) -> State:
    """The search again without wild samples and repeated ones, where there are a few.

    Where those are less of what is left than a prediction is off by, the sets are only fitted
    again: the search would propose the same ones.
    """
    again = _left_out(state, state.fit, without_wild)
    if again is state:
        return state
    out = np.concatenate([~series.counted for series in again.problem.data])
    decided = float(np.sum(state.fit.residual[out] ** 2))
    if decided > LINEARITY_ERROR * (state.fit.rss - state.sets.noise_rss(state.fit)):
        return search_catalogue(again)
    again.sets.fit_again(state.sets)
    return replace(again, fit=again.sets.best())


def _left_out(state: State, fit: Fit, without: LeaveOut) -> State:
    """`state` without the samples that `without` leaves out by what `fit` leaves of a series."""
    left = state.sets.residuals.in_units(fit.residual)
    parts = [without(series, own) for series, own in zip(state.problem.data, left, strict=True)]
    notes = tuple(note for _, own in parts for note in own)
    if not notes:
        return state
    again = State.of(replace(state.problem, data=tuple(series for series, _ in parts)))
    return replace(again, notes=(*state.notes, *notes))


def refine_steps(state: State) -> State:
    """The search again with a finer simulation, where its steps may be what remains."""
    finer = state.problem.finer
    if finer is None or state.sets.is_noise(state.fit) or not _steps_matter(state, finer):
        return state
    state.problem.progress("refitting with a finer simulation")
    finer = WithLaws(finer, state.problem.data, ())
    again = State.of(
        replace(state.problem, simulate=finer, finer=None, coarse=state.problem.simulate)
    )
    return search_catalogue(replace(again, notes=state.notes))


def _steps_matter(state: State, finer: Simulate) -> bool:
    """True if a residual beyond noise may come from the steps of the coarse simulation."""
    fit, residuals = state.fit, state.sets.residuals
    fine = residuals.of_model(finer, None).at(fit.settings)
    # Sensor noise that wanders is not white, hides no effect, and looks like one.
    most = 1.0 if residuals.known_noise else np.inf
    parts = residuals.split(fit.residual)
    white = sum(len(own) * min(difference_variance(own), most) for own in parts)
    # A change of δ takes at most 2 δ √excess away.
    share = (LEAST_SHARE / 2) ** 2
    least = max(SAME * state.sets.scale(fit), share * (fit.rss - white))
    return float(np.sum((fine - fit.residual) ** 2)) > least


def restate_quiet_noise(state: State) -> State:
    """The search again with the noise that the data show, where they are quieter than stated."""
    sets = state.sets
    mean = sets.evidence.noise.sums(state.fit.residual) / np.array(sets.evidence.noise.counts)
    samples = Noise.as_stated(sets.residuals).like(state.fit.residual).samples
    below = mean * (1 + _STANDARD_ERRORS * np.sqrt(2 / samples)) < (1 + TOLERANCE) ** -2
    data, notes, restated = [], list(state.notes), False
    for series, is_below, m in zip(state.problem.data, below, mean, strict=True):
        if series.sigma is not None and is_below:
            sigma = series.sigma * float(np.sqrt(m))
            notes.append(
                f"{series.sensor} in {series.run} is quieter than stated: its noise is "
                f"{sigma:.3g} {series.unit}, {np.sqrt(m):.2g} times as much"
            )
            # A sensor at rest shows none of its noise, and is no measure of it.
            if m > LEAST_SHARE**2:
                series, restated = replace(series, sigma=sigma), True
        data.append(series)
    if not restated:
        return replace(state, notes=tuple(notes))
    again = State.of(replace(state.problem, data=tuple(data)))
    return add_laws(search_catalogue(replace(again, notes=tuple(notes))))


def add_laws(state: State) -> State:
    """The search continued with free-form terms beside the catalogue, where something is left.

    A set that needs several effects, or a flexible one, may stand for one that nobody listed. So
    may a single one in whose place a term of the measurement, which costs no simulation, is
    predicted to do as well, or beside which it is predicted to do better.
    """
    noise = state.sets.is_noise(state.fit)
    if noise and not state.fit.candidates:
        return state
    problem = state.problem
    laws = measurement_laws(problem.data, complete=noise)
    sets, terms = state.sets, (*laws, *problem.unlisted)
    coarse = problem.coarse and WithLaws(problem.coarse, problem.data, laws)
    sets.join(terms, WithLaws(problem.simulate, problem.data, laws), coarse)
    own = state.fit.candidates
    doubtful = len(own) > 1 or any(c.flexible or c.run is not None for c in own)
    if noise and not doubtful and not _rivalled(state, laws):
        sets.leave_out({term.name for term in terms})
        return state
    repeated = [(term, state.screening.listed_like(term)) for term in terms]
    sets.leave_out({term.name for term, listed in repeated if listed})
    state = replace(state, terms={key: term for term, listed in repeated for key in listed})
    # Several effects may make up for one that nobody listed beside a single one. Where they leave
    # noise, what may stand beside one of them is found from their own neighbourhood.
    single = next((fit for fit in sets.ranked() if len(fit.candidates) == 1), state.fit)
    part = single.key <= state.fit.key
    fronts = [state.fit, *([] if part and noise else [single])]
    search(sets, state.screening, fronts, only_laws=noise)
    best, listed = sets.best(), sets.best_listed()
    # What somebody has listed has the benefit of the doubt, if it is no more.
    doubt = 0.0 if len(best.candidates) < len(listed.candidates) else VERY_STRONG
    stays = sets.ebic(listed) - sets.ebic(best) < doubt
    return replace(state, fit=listed if stays else best)


def _rivalled(state: State, laws: Sequence[Candidate]) -> bool:
    """True if one of `laws` is predicted to do as well as the answer, or very well beside it."""
    sets, screening, fit = state.sets, state.screening, state.fit
    limit = sets.white.ebic(fit)
    return any(
        screening.predicted_ebic(base, score) < limit + margin
        and not screening.listed_like(score.candidate)
        for base, margin in ((sets.null, VERY_STRONG), (fit, -VERY_STRONG))
        for score in screening.of(base, laws, at=sets.null)
    )


def settle(state: State) -> State:
    """The answer at its minimum; if something is left, also what it leaves without each effect.

    There fits end in narrow valleys.
    """
    sets, fit = state.sets, state.fit
    if not sets.is_noise(fit):
        for name in sorted(fit.names):
            sets.settled(sets.without(fit, name))
    return replace(state, fit=sets.settled(fit))


def eliminate(state: State) -> State:
    """The answer without effects that save less than strong evidence, a Bayes factor of 20."""
    fit, rejected = state.fit, list(state.rejected)
    while fit.candidates:
        reduced = [(state.sets.without(fit, name), name) for name in sorted(fit.names)]
        best, name = min(reduced, key=lambda pair: state.sets.ebic(pair[0]))
        if state.sets.ebic(best) > state.sets.ebic(fit) + STRONG:
            break
        rejected.append(Rejected(name, best.rss - fit.rss, _NO_GAIN))
        fit = best
    return replace(state, fit=fit, rejected=tuple(rejected))


def hold_out(state: State) -> State:
    """The answer without effects that held-out parts do not support.

    Of several the one is dropped first that the data miss least: one whose absence leaves
    much may fail for what another one does beside it.
    """
    sets, fit, rejected = state.sets, state.fit, list(state.rejected)
    while (held := _held(sets, fit)) is not None:
        failing = [name for name in sorted(fit.names) if not held.supports(name)]
        if not failing:
            break
        without = {name: sets.without(fit, name) for name in failing}
        worst = min(failing, key=lambda name: sets.ebic(without[name]))
        rejected.append(Rejected(worst, without[worst].rss - fit.rss, FAILS_HELD_OUT))
        fit = without[worst]
    return replace(state, fit=fit, held=held, rejected=tuple(rejected))


def _held(sets: Hypotheses, fit: Fit) -> HeldOut | None:
    """Prediction of held-out parts with and without each effect of `fit`; None without any."""
    if not fit.candidates:
        return None
    without = {name: sets.without(fit, name) for name in sorted(fit.names)}
    return held_out(sets.residuals, sets.evidence.noise, sets.null, fit, without)


def drop_outweighed(state: State) -> State:
    """The answer without effects that explain less than stays unexplained, the least dropped first.

    What nobody listed is there and is the larger: by itself it looks like several listed effects
    as well, in every part of the data. What free-form terms describe, also as drafts, does not
    stay unexplained. Calibrations, which name nothing, stay.
    """
    sets = state.sets
    while not sets.leaves_noise(described := state.drafted or state.fit):
        left = described.rss - sets.noise_rss(described)
        fit = state.fit
        listed = sorted(
            c.name for c in fit.candidates if not c.law and not sets.evidence.calibrated(fit, c)
        )
        gains = {name: sets.without(fit, name).rss - fit.rss for name in listed}
        weak = (n for n in sorted(listed, key=gains.__getitem__) if gains[n] < left)
        # An effect whose place a term would fill explains more than its absence costs.
        name = next(
            (n for n in weak if not fit.laws or explained_by(sets.residuals, fit, n) < left), None
        )
        if name is None:
            break
        dropped = Rejected(name, gains[name], _OUTWEIGHED)
        drafted = state.drafted and sets.without(state.drafted, name)
        rejected = (*state.rejected, dropped)
        state = replace(state, fit=sets.without(fit, name), drafted=drafted, rejected=rejected)
    return state


def prefer_lower(state: State) -> State:
    """The answer, or a fitted set of no more effects that has a lower EBIC, once some are dropped.

    An effect that goes may have led to a choice among others that is worse without it. In place of
    a stand-in nothing is preferred: another one would be.
    """
    sets, fit = state.sets, state.fit
    dropped = {r.name for r in state.rejected}
    if state.stand_ins:
        return state
    others = [
        other
        for other in sets.ranked()
        if len(other.candidates) <= len(fit.candidates)
        and not dropped & other.names
        and other.laws <= fit.names
    ]
    lower = sets.evidence.lowest([fit, *others])
    if not dropped or lower.key == fit.key:
        return state
    return replace(state, fit=sets.settled(lower))


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
        rejected.append(Rejected(name, less.rss - fit.rss, _NO_GAIN))
        fit = less
    sets.judge_by(fit)
    if state.fit.laws:
        # Beside the terms an effect may have had another form.
        fit = sets.evidence.lowest([fit, *sets.fit_all(in_other_forms(sets, fit))])
        alone = replace(state, fit=fit, drafted=state.fit, rejected=tuple(rejected))
        exposed = expose_beside_drafts(alone)
        if exposed.drafted is state.fit and sets.is_noise(state.fit):
            # Nothing is left that an effect may stand for: those beside the terms are there.
            return replace(exposed, held=_held(sets, exposed.fit), drafted_held=state.held)
        weighed = drop_outweighed(eliminate(exposed))
        assert weighed.drafted is not None, "the drafts stay"
        held = state.held if weighed.drafted is state.fit else _held(sets, weighed.drafted)
        return hold_out(replace(weighed, drafted_held=held))
    # What passed for noise with a memory may not, by the noise that the listed effects leave.
    outweighed = drop_outweighed(replace(state, fit=fit, rejected=tuple(rejected)))
    return hold_out(outweighed) if outweighed.fit is not state.fit else state


def examine_remainder(state: State) -> State:
    """The tests of what is left: noise, of whatever size and memory, or something unexplained."""
    sets, fit = state.sets, state.fit
    if state.drafted is not None:
        return replace(state, remainder=_described_by_drafts(sets, fit, state.drafted))
    remainder = examine(sets.residuals, fit.residual, len(fit.order))
    if not remainder.significant:
        wild = sum(int(s.wild.sum()) for s in sets.residuals.data if s.wild is not None)
        if wild:
            remainder = replace(remainder, description=f"wild samples: {wild}", variable="sensor")
        return replace(state, remainder=remainder)
    note = as_noise(sets.residuals, sets.evidence.noise, fit.residual, remainder)
    if note is None:
        return replace(state, remainder=remainder)
    return replace(state, remainder=replace(remainder, significant=False, note=note))


def _described_by_drafts(sets: Hypotheses, fit: Fit, drafted: Fit) -> Remainder:
    """Remainder of `fit`, described as a function of the main draft's variable, and of the drafts.

    A shape of another variable is no description: the draft explains what looks like that as well.
    """
    variable = _main_law(sets, drafted).of
    remainder = examine(sets.residuals, fit.residual, len(fit.order), variable)
    described = remainder.description if remainder.variable == variable else f"a law of {variable}"
    in_turn = examine(sets.residuals, drafted.residual, len(drafted.order))
    return replace(
        remainder, significant=True, description=described, variable=variable, only_size=False,
        beside_drafts=None if sets.leaves_noise(drafted) else in_turn.description,
    )  # fmt: skip


def _main_law(sets: Hypotheses, drafted: Fit) -> Law:
    """The free-form term that explains most."""
    laws = {c.name: c.law for c in drafted.candidates if c.law}
    return laws[max(laws, key=lambda name: (sets.without(drafted, name).rss, name))]


def find_alternatives(state: State) -> State:
    """Other sets that the data cannot distinguish from the answer.

    One that explains them equally well takes its place if its effects are listed before. Of those
    with free-form terms the best is told apart: what somebody has listed has the benefit of the
    doubt.
    """
    if not state.fit.candidates:
        return state
    every = alternatives(state.sets, state.screening, state.fit)
    if (first := _listed_first(state, every)) is not state:
        state = first
        every = alternatives(state.sets, state.screening, state.fit)
    listed = tuple(other for other in every if not other.laws)
    names = next((other.names for other in every if other.laws), None)
    rival = next((fit for fit in state.sets.ranked() if fit.names == names), None)
    state = replace(state, alternatives=listed, rival=rival)
    if rival is None or state.drafted is not None:
        return state
    return replace(state, drafted_held=_held(state.sets, rival))


def _listed_first(state: State, every: Sequence[Alternative]) -> State:
    """The state with that one of equal sets whose effects are listed first.

    Which of them the search meets first is up to rounding. A set with strong evidence over the
    answer is none of them: the passes are taken again from there (`better_alternative`). With
    drafts beside it the answer stays, and what was dropped from it stays away.
    """
    sets, dropped = state.sets, {r.name for r in state.rejected}
    names = {other.names for other in every if not other.laws and not dropped & other.names}
    least = sets.ebic(state.fit) - STRONG
    equal = [fit for fit in sets.ranked() if fit.names in names and sets.ebic(fit) >= least]
    first = sets.evidence.lowest([state.fit, *equal])
    if state.drafted is not None or first is state.fit:
        return state
    held = _held(sets, first)
    if held is None or not all(map(held.supports, first.names)):
        return state
    return replace(state, fit=first, held=held)


def better_alternative(state: State) -> Fit | None:
    """The fitted alternative that the data support strongly over the answer; None if none.

    A search that strong effects mislead may end in a set that a fit from elsewhere shows to be
    none of the best. What was dropped from the answer would be dropped again.
    """
    dropped = {r.name for r in state.rejected}
    better = {
        other.names
        for other in state.alternatives
        if other.delta_ebic < -STRONG and not dropped & other.names
    }
    return next((fit for fit in state.sets.ranked() if fit.names in better), None)


def drop_unsupported(state: State) -> State:
    """The passes that drop what is not there, again and again until the answer stays.

    What one of them drops may be what another one was satisfied with, and may have led to a
    choice among others (`prefer_lower`), which they judge as well.
    """
    while True:
        before = state.fit
        for each in (expose_stand_ins, drop_outweighed, hold_out, prefer_lower):
            state = each(state)
        if state.fit.key == before.key:
            return state


def readmit(state: State) -> State:
    """The answer with listed effects that held-out parts denied only beside what went after them.

    An effect is dropped for what it does beside the others. If those go as well, the order in
    which they went must not decide.
    """
    names = [r.name for r in state.rejected]
    denied = [r.name for r in state.rejected if r.reason == FAILS_HELD_OUT]
    for name in denied:
        candidate = next((c for c in state.sets.catalogue if c.name == name), None)
        if candidate is None or candidate.law or name == names[-1]:
            continue
        joined = _joined(state.sets, state.fit, name)
        if state.sets.ebic(joined) > state.sets.ebic(state.fit) - STRONG:
            continue
        others = tuple(r for r in state.rejected if r.name != name)
        again = drop_unsupported(replace(state, fit=joined, rejected=others))
        if name in again.fit.names:
            state = again
    return state


def _joined(sets: Hypotheses, fit: Fit, name: str) -> Fit:
    """`fit` with the effect `name`, as it is in the best set that has it."""
    best = next(other for other in sets.ranked() if name in other.names)
    (own,) = (c for c in best.candidates if c.name == name)
    return sets.fitted((*fit.candidates, own), {**fit.settings, name: best.settings[name]})


PASSES: tuple[Pass, ...] = (
    set_ends_aside,
    search_catalogue,
    set_wild_aside,
    refine_steps,
    add_laws,
    restate_quiet_noise,
    settle,
    eliminate,
    expose_stand_ins,
    drop_outweighed,
    prefer_lower,
    drop_unsupported,
    readmit,
    set_laws_apart,
    find_alternatives,
    examine_remainder,
)
