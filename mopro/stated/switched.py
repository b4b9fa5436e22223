"""The effects that a machine's file switches on, in the units that the experiment has them in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from difflib import get_close_matches

from mopro.errors import ModelError
from mopro.formula import dimension_of_unit
from mopro.formula.dimension import factor_of
from mopro.formula.written import EffectParameter, WrittenEffect
from mopro.stated.data import StatedExperiment
from mopro.stated.model import StatedMachine
from mopro.stated.names import effects_of, listed_of
from mopro.stated.of_sensors import BEGINNINGS
from mopro.tomlfile import Document


def as_stated(experiment: StatedExperiment) -> StatedExperiment:
    """The experiment with the values of its machine's `[effects]` in the units of their parameters.

    The units of a listed effect are those of the experiment, and the file may have been written
    with another one. What these data lack is left out, with a note. ModelError for an effect or a
    parameter that does not exist, and for a unit of another quantity.
    """
    machine, effects = experiment.machine, effects_of(experiment)
    usable = {effect.name for effect in effects}
    _check_names(machine, effects, usable | {effect.name for effect in listed_of(experiment)})
    active = {
        name: {key: _in_its_unit(machine, name, key, value, effects) for key, value in own.items()}
        for name, own in machine.active.items()
        if name in usable
    }
    left_out = tuple(
        f"{name} of {machine.name} is left out: these data lack what it acts on"
        for name in machine.active
        if name not in usable
    )
    machine = replace(machine, active=active, units={})
    return replace(experiment, machine=machine, notes=experiment.notes + left_out)


def _check_names(machine: StatedMachine, effects: Iterable[WrittenEffect], known: set[str]) -> None:
    for name, own in machine.active.items():
        # One of a sensor that is not in these data is of another experiment.
        if name not in known and not name.startswith(BEGINNINGS):
            raise _error(machine, (name,), f"there is no effect {name}", "unknown-effect", known)
        keys = {p.name for p in _parameters(effects, name)}
        for key in own:
            if keys and key not in keys:
                message = f"{name} has no parameter {key}"
                raise _error(machine, (name, key), message, "unknown-parameter", keys)


def _parameters(effects: Iterable[WrittenEffect], name: str) -> Iterator[EffectParameter]:
    """The parameters of an effect in all its forms."""
    return (p for effect in effects if effect.name == name for p in effect.parameters)


def _in_its_unit(
    machine: StatedMachine, name: str, key: str, value: float, effects: Iterable[WrittenEffect]
) -> float:
    stated = machine.units.get(name, {}).get(key)
    own = next(p.unit for p in _parameters(effects, name) if p.name == key)
    if stated is None or stated == own:
        return value
    if dimension_of_unit(stated) != dimension_of_unit(own):
        message = f"{key} is stated in {stated}, and is in {own}"
        raise _error(machine, (name, key), message, "wrong-unit", ())
    return value * factor_of(stated) / factor_of(own)


def _error(
    machine: StatedMachine, place: tuple[str, ...], message: str, rule: str, known: Iterable[str]
) -> ModelError:
    value = Document(machine.source).root["effects"]
    for key in place:
        value = value[key]
    names = sorted(known)
    near = get_close_matches(place[-1], names, n=1)
    hint = f"did you mean `{near[0]}`?" if near else f"known are {', '.join(names)}"
    return value.error(message, rule, hint if names else None)
