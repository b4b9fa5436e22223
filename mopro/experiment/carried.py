"""Numbers of a machine's file on runs that it was not fitted to: which of them hold there too."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mopro.effects.effect import without_run
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
    in `unit`; None where the effect cannot be fitted to them. `word`: CARRIED where its 95 %
    interval holds the file's value, DIFFERS where not, NOT_TOLD where the effect might as well be
    off here, or nothing but its range bounds the number.
    """

    effect: str
    parameter: str
    unit: str
    filed: float
    here: Estimate | None
    word: str

    def as_json(self) -> dict[str, Any]:
        ends = (math.nan, math.nan) if self.here is None else self.here.ci95
        return {
            "effect": self.effect,
            "parameter": self.parameter,
            "unit": self.unit,
            "file": self.filed,
            "here": None if self.here is None else self.here.value,
            "ci95": [end if math.isfinite(end) else None for end in ends],
            "carried": self.word,
        }


def carried(system: System) -> tuple[Carried, ...]:
    """Each number of the effects that the machine's file has on in these runs, fitted anew.

    Numbers that each run has of its own, as an angle, are fitted beside them.
    """
    filed, chosen = system.filed, dict[str, Candidate]()
    if not filed:
        return ()

    def asked(own: System) -> Verdict:
        question = own.question(())
        forms = ((name, _as_filed(question.effects, name, of)) for name, of in filed.items())
        chosen.update((name, form) for name, form in forms if form is not None)
        start = {name: _start(form, filed[name]) for name, form in chosen.items()}
        effects = list(chosen.values())
        again = replace(question, effects=effects, unlisted=(), in_one_run={})
        return reconcile(**vars(again), passes=(fit_given(start),))

    _, verdict = system.judged(asked, ())
    found = {effect.name: effect.parameters for effect in verdict.fitted}
    return tuple(
        number
        for name, own in filed.items()
        for number in _numbers(name, own, chosen.get(name), found.get(name, {}))
    )


def _as_filed(every: Sequence[Candidate], name: str, own: Mapping[str, float]) -> Candidate | None:
    """The form of an effect that the file states; None without any.

    That of the fewest parameters whose others are as the form has them: a file states all of them,
    also those that were not fitted.
    """
    forms = [c for c in every if c.name == name and _of_machine(c).keys() <= own.keys()]
    exact = [
        c
        for c in forms
        if all(own[n] == c.fixed.get(n, 0.0) for n in own.keys() - _fitted_in(c, own))
    ]
    largest = max(forms, key=lambda c: len(c.parameters), default=None)
    best = min(exact, key=lambda c: len(c.parameters), default=largest)
    return best and replace(
        best, parameters=tuple(_about(p, _filed(p, own)) for p in best.parameters)
    )


def _of_machine(candidate: Candidate) -> dict[str, Parameter]:
    """The parameters that all runs share, by name."""
    return {p.name: p for p in candidate.parameters if p.run is None}


def _fitted_in(candidate: Candidate, own: Mapping[str, float]) -> set[str]:
    """The numbers of the file that a form fits, also those that each run has of its own."""
    return {n for n in own for p in candidate.parameters if _is_of(p, n)}


def _is_of(parameter: Parameter, name: str) -> bool:
    """True if it is the file's number `name`; that of a run has the run's number after it."""
    own = parameter.name
    return (own if parameter.run is None else without_run(own)) == name


def _filed(parameter: Parameter, own: Mapping[str, float]) -> float:
    return next((value for name, value in own.items() if _is_of(parameter, name)), 0.0)


def _about(parameter: Parameter, value: float) -> Parameter:
    """`parameter` whose range goes past `value`, which the sizes of other data may lie below."""
    if parameter.role is not Role.AMPLITUDE:
        return parameter
    reach = PROPORTIONAL * abs(value)
    low = parameter.low if parameter.low >= 0 else min(parameter.low, -reach)
    return replace(parameter, low=low, high=max(parameter.high, reach))


def _start(candidate: Candidate, own: Mapping[str, float]) -> dict[str, float]:
    found = {p.name: p.within(_filed(p, own)) for p in candidate.parameters}
    return {**candidate.fixed, **found}


def _numbers(
    name: str,
    own: Mapping[str, float],
    form: Candidate | None,
    found: Mapping[str, Estimate],
) -> Iterator[Carried]:
    """The numbers of one effect, of which `found` are those fitted here."""
    parameters = {} if form is None else _of_machine(form)
    sizes = [found[n] for n, p in parameters.items() if n in found and p.role is Role.AMPLITUDE]
    off = bool(sizes) and all(size.ci95[0] <= 0 <= size.ci95[1] for size in sizes)
    shown = [n for n in own if n in found and n in parameters]
    if not shown:
        yield from (Carried(name, n, "", value, None, NOT_TOLD) for n, value in own.items())
    for n in shown:
        here, p = found[n], parameters[n]
        yield Carried(name, n, p.unit, own[n], here, NOT_TOLD if off else _word(own[n], here, p))


def _word(value: float, here: Estimate, parameter: Parameter) -> str:
    low, high = here.ci95
    if here.at_bound or not (math.isfinite(low) and math.isfinite(high)):
        return NOT_TOLD
    if parameter.role is Role.PHASE:
        if high - low >= 2 * math.pi:
            return NOT_TOLD
        value += 2 * math.pi * round((here.value - value) / (2 * math.pi))
    return CARRIED if low <= value <= high else DIFFERS
