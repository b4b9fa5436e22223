"""The catalogue's effects as candidates of the diagnosis.

Each effect says in which forms it is fitted; here stands which of them an experiment's
quantities call for, and what the machine's own file makes of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from mopro.diagnosis import Candidate, Parameter, Role
from mopro.effects import Domain, Effect, catalogue
from mopro.effects.base import AXIS, WIDER
from mopro.experiment.diagnose import thermal
from mopro.experiment.predict.forward_model import ForwardModel
from mopro.instruments.quantity import Quantity
from mopro.machine import Machine

# What a machine has already is tried this share of the range away from it.
_APART = 0.1


def candidates(motor: ForwardModel) -> list[Candidate]:
    """What the experiment's sensors could show, in all forms."""
    experiment = motor.experiment
    quantities = {r.sensor.quantity for t in experiment.trials for r in t.readings}
    found: list[Candidate] = []
    slow = any(quantity.slow for quantity in quantities)
    if any(quantity.follows_motion for quantity in quantities):
        found += _of_motion(motor)
    if slow or experiment.tables:
        found += _of_heat(motor, lasting=True)
    if slow:
        found += _of_heat(motor, lasting=False)
    return [_on_the_machine(candidate, motor) for candidate in found]


def _of_motion(motor: ForwardModel) -> Iterator[Candidate]:
    """A program's statements are needed by effects that change them."""
    programmed = all(trial.program is not None for trial in motor.experiment.trials)
    sensors = [reading.sensor for _, reading in motor.readings()]
    for effect in catalogue().values():
        if effect.domain is Domain.HEAT or (effect.changes_program and not programmed):
            continue
        seen = {s.axis for s in sensors if _shows(effect, s.quantity)}
        if not seen:
            continue
        for candidate in effect.forms(motor):
            yield candidate
            if effect.domain is Domain.MEASUREMENT and len(seen) > 1:
                yield from (_on_one(candidate, axis) for axis in sorted(seen))


def _shows(effect: Effect, quantity: Quantity) -> bool:
    """Whether a sensor of `quantity` follows the motion and could show what is no heat."""
    reaches = effect.domain is not Domain.MEASUREMENT or effect.retimes or quantity.sees_place
    return quantity.follows_motion and reaches


def _of_heat(motor: ForwardModel, lasting: bool) -> Iterator[Candidate]:
    """What changes a steady state, `lasting`, or only the way there."""
    machine = motor.experiment.machine
    for effect in catalogue().values():
        if effect.domain is Domain.HEAT and thermal.lasts(effect, machine) is lasting:
            yield from effect.forms(motor)


def _on_one(candidate: Candidate, axis: int) -> Candidate:
    """The same on one axis alone, as each has a sensor of its own."""
    form = f"{candidate.form}, axis {axis}".removeprefix(", ")
    extends = f"{candidate.extends}, axis {axis}".removeprefix(", ")
    return replace(
        candidate,
        form=form,
        fixed={**candidate.fixed, AXIS: axis},
        extends=None if candidate.extends is None else extends,
    )


# -- what the machine's file states ------------------------------------------------


def _on_the_machine(candidate: Candidate, motor: ForwardModel) -> Candidate:
    own = motor.own(candidate.name)
    if own:
        candidate = _from_the_machine(candidate, own)
    return _with_tolerance(candidate, catalogue()[candidate.name], motor.experiment.machine)


def _from_the_machine(candidate: Candidate, own: Mapping[str, float]) -> Candidate:
    """An effect that the machine has already, with `own` values, is off where it has those.

    What is no form's, and is not fitted, is as the machine has it.
    """
    fixed = {name: own.get(name, value) for name, value in candidate.fixed.items()}
    parameters = tuple(
        _about(p, own[p.name]) if p.role is Role.AMPLITUDE and p.name in own else p
        for p in candidate.parameters
    )
    return replace(
        candidate, parameters=parameters, fixed=candidate.fixed if candidate.form else fixed
    )


def _about(parameter: Parameter, null: float) -> Parameter:
    """`parameter`, off at `null`, and tried at other values."""
    low, high = parameter.low, parameter.high
    moved = replace(parameter, null=null, low=min(low, null), high=max(high, null))
    place = moved.scaled(null)
    away = moved.value(place + (_APART if place < 1 - _APART else -_APART))
    starts = dict.fromkeys(away if start == null else start for start in parameter.starts)
    return replace(moved, starts=tuple(starts))


def _with_tolerance(candidate: Candidate, effect: Effect, machine: Machine) -> Candidate:
    """An effect that may correct a number which the machine file states with a tolerance.

    The tolerance stays about what the file states, wherever an effect in it has moved that.
    """
    number = effect.toleranced(machine)
    source = machine.provenance.get(number.key) if number else None
    reach = number.scale * source.tolerance if number and source else 0.0
    if number is None or not reach:
        return candidate
    (own,) = candidate.parameters
    middle, stated = number.middle, effect.parameter(own.name)
    low, high = own.plausible or (own.low, own.high)
    tolerant = replace(
        own,
        low=max(min(own.low, middle - WIDER * reach), stated.low),
        high=min(max(own.high, middle + WIDER * reach), stated.high),
        plausible=(min(low, middle - reach), max(high, middle + reach)),
        tolerated=(middle - reach, middle + reach),
    )
    return replace(candidate, parameters=(tolerant,))
