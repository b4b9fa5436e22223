"""Resolves the effects that a machine file states; every fault is reported at its line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from mopro.effects.base import Active, Effect, Parameter
from mopro.effects.registry import Catalogue, in_order
from mopro.errors import MOST_SHOWN, Diagnostic, ModelError
from mopro.machine import Machine, StatedEffect, StatedValue
from mopro.program import AXES
from mopro.source import Source, Span


def active_effects(machine: Machine, catalogue: Catalogue) -> tuple[Active, ...]:
    """The effects that `machine` switches on, in the order in which they act.

    An effect that the file states outside of `[effects]` is added unless it is listed there as
    well. Raises ModelError with all findings.
    """
    resolver = _Resolver(catalogue)
    active = [a for stated in machine.effects if (a := resolver.resolve(stated))]
    if resolver.faults:
        raise ModelError(machine.source or Source(machine.name, ""), resolver.faults)
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

    def resolve(self, stated: StatedEffect) -> Active | None:
        effect = self._catalogue.get(stated.name)
        if effect is None:
            message = f"there is no effect {stated.name}"
            self._report(
                "unknown-effect", message, stated.span, self._near(stated.name, self._catalogue)
            )
            return None
        parameters = {p.name: p for p in effect.parameters}
        for key, value in stated.values.items():
            if key not in parameters:
                message = f"{effect.name} has no parameter {key}"
                self._report("unknown-parameter", message, value.span, self._near(key, parameters))
        values = tuple(self._value(p, stated.values.get(p.name)) for p in effect.parameters)
        return Active(effect, values, stated.axes)

    def _value(self, parameter: Parameter, stated: StatedValue | None) -> float:
        """The value in SI; an unstated one is the default."""
        if stated is None:
            return parameter.default
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


def suggestion(name: str, known: Iterable[str]) -> str:
    """A suggestion for `name`, compared without regard to case."""
    by_lower = {each.lower(): each for each in known}
    near = get_close_matches(name.lower(), by_lower, n=1)
    if near:
        return f"did you mean `{by_lower[near[0]]}`?"
    return f"known are {', '.join(sorted(by_lower.values()))}"
