"""The pass that tests what is left."""

from __future__ import annotations

from dataclasses import replace

from mopro.engine.candidate import Law
from mopro.engine.fits import Fit
from mopro.engine.passes.loops import a_pass
from mopro.engine.residuals import Remainder, as_noise, examine
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.state import State


@a_pass
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
