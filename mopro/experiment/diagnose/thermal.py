"""Steady-state tables for the diagnosis: the series of one, and what its model may lack."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mopro.diagnosis import Candidate, Parameter, Series
from mopro.effects import Effect, Stage, catalogue
from mopro.effects.base import Parameter as Number
from mopro.effects.resolve import values_by_effect
from mopro.experiment.model import SteadyTable
from mopro.experiment.predict.steady import rises
from mopro.machine import Machine


def series(table: SteadyTable) -> Series:
    """The table as the diagnosis reads it: one sensor, each row a part to hold out.

    A rise is the difference of two readings, so there is no offset to take out.
    """
    rows = len(table.rise_K)
    return Series(
        table.name, "temperature", "K", table.rise_K, table.noise_K,
        folds=np.arange(rows), nuisances=np.zeros((rows, 0)),
    )  # fmt: skip


def candidates(machine: Machine) -> list[Candidate]:
    """What a heat balance may lack: the catalogue's effects that change a steady state.

    An effect of several amplitudes is offered with each of them alone, and with all of
    them where one has been found. What is not fitted is as the machine has it, else off;
    temperatures of reference are those of the air.
    """
    stated = values_by_effect(machine, catalogue())
    effects = [e for e in catalogue().values() if e.stage is Stage.HEAT and _steady(e, machine)]
    return [c for e in effects for c in _forms(e, machine.heat.ambient_C, stated.get(e.name, {}))]


def _steady(effect: Effect, machine: Machine) -> bool:
    """Whether it changes where a motion ends up, and not only how it gets there."""
    one = np.array([0.1])
    motion = SteadyTable("", one, one, one, 0 * one, one, None)
    largest = {effect.name: {p.name: p.plausible[1] for p in effect.parameters}}
    return bool((rises(motion, machine, largest) != rises(motion, machine, {})).any())


def _forms(effect: Effect, air_C: float, stated: Mapping[str, float]) -> list[Candidate]:
    fixed = {
        p.name: stated.get(p.name, air_C) for p in effect.parameters if p.dimension == "temperature"
    }
    free = [p for p in effect.parameters if p.dimension != "temperature"]
    if len(free) == 1:
        return [Candidate(effect.name, (_parameter(free[0]),), fixed=fixed)]
    forms = []
    for own in free:
        others = [p for p in free if p is not own]
        without = fixed | {p.name: stated.get(p.name, p.null) for p in others}
        forms.append(Candidate(effect.name, (_parameter(own),), own.name, without))
        both = tuple(map(_parameter, (own, *others)))
        words = " and ".join(p.name for p in both)
        forms.append(Candidate(effect.name, both, words, fixed, extends=own.name))
    return forms


def _parameter(number: Number) -> Parameter:
    """Fitted somewhat beyond the plausible range, so that a bound shows as such."""
    low, high = number.plausible
    reach = max(abs(low), abs(high)) or 1.0
    return Parameter(
        number.name, number.unit, max(number.low, low - reach), min(number.high, high + reach),
        (number.default or high / 2,), null=number.null, plausible=number.plausible,
    )  # fmt: skip
