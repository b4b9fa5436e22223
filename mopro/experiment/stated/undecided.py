"""What the runs of a stated machine cannot tell, and other motions of it would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mopro.engine.verdict import Alike, Named, Verdict
from mopro.experiment.separation import size_error
from mopro.experiment.stated.other_runs import OtherRun, other_runs
from mopro.stated.simulation import Model


def with_undecided(model: Model, verdict: Verdict) -> Verdict:
    """The verdict, ambiguous with the sets that predict the same here and not elsewhere.

    A set that predicts the same in all other motions as well is the answer in other words.
    """
    others = [other for other in verdict.alike if _lacks(other, verdict)]
    if verdict.verdict not in ("named", "ambiguous") or not others:
        return verdict
    runs = other_runs(model, verdict)
    undecided = [each for each in others if any(_is_told(run, each, verdict) for run in runs)]
    if not undecided:
        return verdict
    names = [*verdict.alternatives, *(tuple(sorted(other.names)) for other in undecided)]
    return replace(
        verdict,
        verdict="ambiguous",
        effects=tuple(_beside(effect, undecided, verdict) for effect in verdict.effects),
        alternatives=tuple(dict.fromkeys(names)),
    )


def _lacks(other: Alike, verdict: Verdict) -> bool:
    return any(effect.name not in other.names for effect in verdict.effects)


def _is_told(run: OtherRun, other: Alike, verdict: Verdict) -> bool:
    lacking = (effect for effect in verdict.effects if effect.name not in other.names)
    error = max(size_error(effect) for effect in lacking)
    return run.apart(verdict.settings, other.settings, verdict.base_before, error).told


def _beside(effect: Named, undecided: Sequence[Alike], verdict: Verdict) -> Named:
    """The effect with what stands in its place in the undecided sets among its alternatives."""
    answer = {own.name for own in verdict.fitted}
    for other in undecided:
        if effect.name not in other.names:
            for rival in sorted(other.names - answer):
                effect = effect.with_rival(rival, other.delta_ebic, other.settings)
    return effect
