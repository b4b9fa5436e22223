"""Resolves the effects that a machine file states; every fault is reported at its line."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from difflib import get_close_matches

from mopro.effects.effect import Active, Effect, Parameter, angle_in
from mopro.effects.registry import Catalogue, in_order
from mopro.errors import MOST_SHOWN, Diagnostic, ModelError
from mopro.machine import Machine, StatedEffect, StatedValue
from mopro.machine.run_effects import NO_DATA, Data, nth_of
from mopro.program import AXES
from mopro.source import Source, Span


def active_effects(
    machine: Machine, catalogue: Catalogue, data: Data = NO_DATA
) -> tuple[Active, ...]:
    """The effects that `machine` switches on in a run, in the order in which they act.

    `data`: the run's data file. Those that belong to other runs are off, as they are in a run
    without data. Raises ModelError with all findings.
    """
    absent = {name for name, runs in machine.runs.items() if nth_of(data, runs) is None}
    return stated_effects(machine, catalogue, data, absent)


def stated_effects(
    machine: Machine, catalogue: Catalogue, data: Data = NO_DATA, absent: Collection[str] = ()
) -> tuple[Active, ...]:
    """The effects that `machine` states, whatever runs they belong to, without those in `absent`.

    Each has the values of the run with this `data`, or else of the first of its runs. An effect
    that the file states outside of `[effects]` is added unless it is listed there as well. Raises
    ModelError with all findings.
    """
    resolver = _Resolver(catalogue)
    resolved = [a for stated in machine.effects if (a := resolver.resolve(stated, data))]
    if resolver.faults:
        raise ModelError(machine.source or Source(machine.name, ""), resolver.faults)
    active = [a for a in resolved if a.name not in absent]
    names = {a.name for a in active}
    for effect in catalogue.stated_elsewhere():
        values = effect.stated_by(machine)
        if values is not None and effect.name not in names:
            active.append(Active(effect, values, AXES))
    return in_order(active, catalogue)


def with_values(
    effect: Effect, values: Mapping[str, float], axes: tuple[int, ...] = AXES
) -> Active:
    """`effect` with `values` (SI) by its parameters' names; unstated ones are the defaults."""
    numbers = tuple(float(values.get(p.name, p.default)) for p in effect.parameters)
    return Active(effect, numbers, axes)


class _Resolver:
    def __init__(self, catalogue: Catalogue) -> None:
        self.faults: list[Diagnostic] = []
        self._catalogue = catalogue

    def resolve(self, stated: StatedEffect, data: Data) -> Active | None:
        effect = self._catalogue.get(stated.name)
        if effect is None:
            message = f"there is no effect {stated.name}"
            self._report(
                "unknown-effect", message, stated.span, self._near(stated.name, self._catalogue)
            )
            return None
        angles = _angles(effect, stated)
        known = {p.name: p for p in effect.parameters} | {n: p for own in angles for n, p in own}
        for key, value in stated.values.items():
            if key not in known:
                message = f"{effect.name} has no parameter {key}"
                self._report("unknown-parameter", message, value.span, self._near(key, known))
        found = {n: self._value(known[n], v) for n, v in stated.values.items() if n in known}
        nth = nth_of(data, stated.runs) or 0
        in_run = {p.name: found[n] for own in angles[nth : nth + 1] for n, p in own if n in found}
        return with_values(effect, found | in_run, stated.axes)

    def _value(self, parameter: Parameter, stated: StatedValue) -> float:
        """The value in SI; the default after a finding about its unit."""
        value = stated.number
        if stated.unit is not None:
            try:
                value = parameter.converted(value, stated.unit)
            except ValueError as error:
                self._report("wrong-unit", f"{parameter.name}: {error}", stated.span)
                return parameter.default
        if fault := parameter.fault(value):
            self._report("bad-value", fault, stated.span, f"it is {parameter.meaning}")
        return value

    def _near(self, name: str, known: Iterable[str]) -> str | None:
        """A suggestion, only while a report would show it, as comparing names takes long."""
        return suggestion(name, known) if len(self.faults) < MOST_SHOWN else None

    def _report(self, rule: str, message: str, span: Span, hint: str | None = None) -> None:
        self.faults.append(Diagnostic(rule, message, span, hint=hint))


def _angles(effect: Effect, stated: StatedEffect) -> list[list[tuple[str, Parameter]]]:
    """The names that the effect's `per_run` parameters have in each of the runs that it is of."""
    angles = [p for p in effect.parameters if p.per_run]
    return [[(angle_in(nth, p.name), p) for p in angles] for nth in range(len(stated.runs))]


def suggestion(name: str, known: Iterable[str]) -> str:
    """A suggestion for `name`, compared without regard to case."""
    by_lower = {each.lower(): each for each in known}
    near = get_close_matches(name.lower(), by_lower, n=1)
    if near:
        return f"did you mean `{by_lower[near[0]]}`?"
    return f"known are {', '.join(sorted(by_lower.values()))}"
