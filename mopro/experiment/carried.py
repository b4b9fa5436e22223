"""Numbers of a machine's file on runs that it was not fitted to: which of them hold there too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mopro.engine import reconcile
from mopro.engine.assumed import PROPORTIONAL
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.passes.given import fit_given
from mopro.engine.verdict import Estimate, Verdict
from mopro.experiment.system import System

CARRIED, DIFFERS, NOT_TOLD = "carried over", "differs", "not told by these data"


@dataclass(frozen=True)
class Carried:
    """A parameter of an effect in a machine's file, and as these data have it.

    `filed`: the file's value; `here`: that of a fit of all effects of the file to these data, both
    in the same unit. `word`: CARRIED where its 95 % interval holds the file's value, DIFFERS where
    not, NOT_TOLD where the effect might as well be off here, or nothing but its range bounds the
    number.
    """

    effect: str
    parameter: str
    filed: float
    here: Estimate
    word: str

    def as_json(self) -> dict[str, Any]:
        return {
            "effect": self.effect,
            "parameter": self.parameter,
            "unit": self.here.unit,
            "file": self.filed,
            "here": self.here.value,
            "ci95": list(self.here.ci95),
            "carried": self.word,
        }


def carried(system: System) -> tuple[Carried, ...]:
    """Each number of the effects that the machine's file has on in these runs, fitted anew."""
    filed = system.filed
    if not filed:
        return ()
    _, verdict = system.judged(lambda own: _refitted(own, filed), ())
    return tuple(_numbers(verdict, filed))


def _refitted(system: System, filed: Mapping[str, Mapping[str, float]]) -> Verdict:
    """The verdict of which the effects are those of the file, fitted from its values."""
    question = system.question(())
    chosen = [_as_filed(question.effects, name, own) for name, own in filed.items()]
    start = {c.name: _start(c, filed[c.name]) for c in chosen if c is not None}
    effects = [c for c in chosen if c is not None]
    asked = replace(question, effects=effects, unlisted=(), in_one_run={})
    return reconcile(**vars(asked), passes=(fit_given(start),))


def _as_filed(every: Sequence[Candidate], name: str, own: Mapping[str, float]) -> Candidate | None:
    """The form of an effect with the most parameters that the file states; None without any."""
    forms = [c for c in every if c.name == name and {p.name for p in c.parameters} <= own.keys()]
    best = max(forms, key=lambda c: len(c.parameters), default=None)
    return best and replace(best, parameters=tuple(_about(p, own[p.name]) for p in best.parameters))


def _about(parameter: Parameter, value: float) -> Parameter:
    """`parameter` whose range goes past `value`, which the sizes of other data may lie below."""
    if parameter.role is not Role.AMPLITUDE:
        return parameter
    reach = PROPORTIONAL * abs(value)
    low = parameter.low if parameter.low >= 0 else min(parameter.low, -reach)
    return replace(parameter, low=low, high=max(parameter.high, reach))


def _start(candidate: Candidate, own: Mapping[str, float]) -> dict[str, float]:
    found = {p.name: p.within(own[p.name]) for p in candidate.parameters}
    return {**candidate.fixed, **found}


def _numbers(verdict: Verdict, filed: Mapping[str, Mapping[str, float]]) -> Iterator[Carried]:
    for effect in verdict.fitted:
        for name, here in effect.parameters.items():
            value = filed[effect.name][name]
            yield Carried(effect.name, name, value, here, _word(value, here))


def _word(value: float, here: Estimate) -> str:
    low, high = here.ci95
    if here.at_bound or not (math.isfinite(low) and math.isfinite(high)):
        return NOT_TOLD
    if not low <= value <= high:
        return DIFFERS
    return NOT_TOLD if low <= 0 <= high else CARRIED
