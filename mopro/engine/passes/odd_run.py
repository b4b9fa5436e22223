"""Passes on a run that alone disagrees with the model, where all others agree."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from mopro.engine.assumed import FALSE_ALARMS, STRONG, VERY_STRONG
from mopro.engine.fits import Fit, least_squares_fit
from mopro.engine.passes.loops import Loop, Pass, a_pass, in_turn
from mopro.engine.residuals import Remainder, Residuals, as_noise, examine, noise_of
from mopro.engine.series import Floats, Mask, Settings
from mopro.engine.state import State
from mopro.engine.verdict import OddRun, Rejected

_OTHERS_WITHOUT = "the other runs agree without it, and not with it"


@a_pass
def find_odd_run(state: State) -> State:
    """The run that alone disagrees, and the set of effects beside which the others agree.

    That is one beside which the other runs, fitted by themselves, leave noise, and of which that
    run does not: none, or the fitted set that describes the others best. With one false alarm in a
    thousand, over all runs. Nothing where nothing stays unexplained, or where it may as well be
    another run.
    """
    names = list(dict.fromkeys(series.run for series in state.problem.data))
    if (
        len(names) < 2
        or not state.remainder.significant
        or not state.hypotheses.residuals.known_noise
    ):
        return state
    for with_effects in (False, True):
        hypotheses = [
            _best_of_others(state, n) if with_effects else state.hypotheses.null for n in names
        ]
        tried = [
            (_odd(state, own, n, len(names)), own) for own, n in zip(hypotheses, names, strict=True)
        ]
        found = [(run, own) for run, own in tried if run is not None]
        if len(found) == 1:
            ((odd, agreed),) = found
            return replace(state, odd=odd, agreed=agreed)
    return state


@dataclass(frozen=True)
class _InOneRun(Loop):
    def __call__(self, state: State) -> State:
        of_run = tuple(state.problem.in_one_run.get(state.odd.run, ())) if state.odd else ()
        if not of_run:
            return state
        wider = replace(state.problem, catalogue=(*state.problem.catalogue, *of_run))
        again = in_turn(self.passes, state.begun(wider))
        return replace(again, odd=state.odd) if _explains(again, state) else state


def in_one_run(*passes: Pass) -> Loop:
    """`passes` with each effect in the odd run alone as well; their answer if that explains it."""
    return _InOneRun(passes)


def _best_of_others(state: State, run: str) -> Fit:
    """The fitted set of listed effects that has the lowest EBIC without the samples of a run."""
    others, evidence = _samples_of_others(state, run), state.hypotheses.white

    def ebic(fit: Fit) -> float:
        return float(np.sum(fit.residual[others] ** 2)) + evidence.penalty(fit)

    return min((fit for fit in state.hypotheses.ranked() if not fit.laws), key=ebic)


def _samples_of_others(state: State, run: str) -> Mask:
    return np.concatenate([np.full(len(s), s.run != run) for s in state.problem.data])


@a_pass
def keep_what_others_bear(state: State) -> State:
    """The answer without what the other runs contradict, and what is left as it is in the odd one.

    An effect, or a draft, that stands for what is in one run alone is none of the machine.
    """
    odd, fit = state.odd, state.agreed
    if odd is None or fit is None:
        return state
    others = _samples_of_others(state, odd.run)

    def contradicted(other: Fit) -> bool:
        more = float(np.sum(other.residual[others] ** 2) - np.sum(fit.residual[others] ** 2))
        return more > VERY_STRONG * state.hypotheses.scale(fit)

    remainder = replace(state.remainder, description=odd.description, variable=odd.variable)
    if state.drafted is not None and not contradicted(state.drafted):
        remainder = state.remainder
    elif state.drafted is not None:
        state = replace(state, drafted=None, drafted_held=None)
        remainder = replace(remainder, beside_drafts=None)
    if not fit.candidates and contradicted(state.fit):
        gone = tuple(
            Rejected(
                name, state.hypotheses.without(state.fit, name).rss - state.fit.rss, _OTHERS_WITHOUT
            )
            for name in sorted(state.fit.names)
        )
        state = replace(
            state, fit=fit, held=None, alternatives=(), rival=None,
            rejected=(*state.rejected, *gone),
        )  # fmt: skip
    return replace(state, remainder=remainder)


def _explains(state: State, before: State) -> bool:
    """True if an effect of one run alone is in the answer, and nothing but noise is left.

    Beside drafts as well, but for such as did so without that effect, or nearly.
    """
    hypotheses, described = state.hypotheses, state.drafted or state.fit
    if not any(c.run for c in state.fit.candidates) or not hypotheses.leaves_noise(described):
        return False
    drafted = before.drafted
    if drafted is None or not hypotheses.leaves_noise(drafted):
        return True
    return hypotheses.ebic(described) < hypotheses.ebic(drafted) - STRONG


def _odd(state: State, fit: Fit, name: str, runs: int) -> OddRun | None:
    """The run `name`, if it disagrees beside the effects of `fit` and the others do not."""
    own = _of_runs(state, [name])
    residual = own.at(fit.settings)
    remainder = _beyond_noise(own, residual, 0)
    if remainder is None or remainder.p_value > FALSE_ALARMS / runs:
        return None
    others = _of_runs(state, [s.run for s in state.problem.data if s.run != name])
    again = least_squares_fit(others, fit.candidates, [fit.settings], base=state.hypotheses.base)
    if _beyond_noise(others, again.residual, len(again.order)) is not None:
        return None
    assert remainder.description is not None, "what is more than noise is described"
    scatter, rest = (float(np.sqrt(np.mean(r**2))) for r in (residual, again.residual))
    return OddRun(name, scatter, rest, remainder.description, remainder.variable)


def _beyond_noise(residuals: Residuals, residual: Floats, parameters: int) -> Remainder | None:
    """The test of a residual; None if it is noise, of whatever size and memory."""
    found = examine(residuals, residual, parameters)
    if not found.significant:
        return None
    noise = noise_of(residuals, residual, parameters)
    return None if as_noise(residuals, noise, residual, found) else found


def _of_runs(state: State, names: Collection[str]) -> Residuals:
    """The problem of these runs alone."""
    problem, hypotheses = state.problem, state.hypotheses
    rows = [i for i, series in enumerate(problem.data) if series.run in names]

    def simulate(settings: Settings) -> list[Floats]:
        predicted = problem.simulate(settings)
        return [predicted[i] for i in rows]

    data, sigmas = [problem.data[i] for i in rows], [hypotheses.residuals.sigmas[i] for i in rows]
    return Residuals(simulate, data, sigmas=sigmas).calibrated_at(hypotheses.null.settings)
