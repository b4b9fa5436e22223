"""Reads effects that a TOML file states as formulas, for any kind of machine."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mopro.formula.dimension import UnitError, dimension_of_unit, product
from mopro.formula.expressions import FUNCTIONS, SIGNALS, Formula, FormulaError, parse
from mopro.formula.written import (
    AMPLITUDE,
    PERIOD,
    ROLES,
    SHAPE,
    EffectParameter,
    Written,
    WrittenEffect,
)
from mopro.tomlfile import Refused, Value, shown
from mopro.tomlfile.schema import flag, number_in, one_of, text

MOST_EFFECTS, MOST_PARAMETERS = 60, 10
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}")
_EFFECT_NAME = re.compile(r"[^\W][^\n\"]{0,59}")
_PLACE = re.compile(r"\{([a-z]+)\}")
_OF_AXES = ("rotary", "angular")
_EFFECT_KEYS = {
    "name", "enters", "formula", "form", "extends", "driven", "unconfirmed", *_OF_AXES,
}  # fmt: skip
_PARAMETER_KEYS = {"unit", "range", "start", "role", "positive"}


@dataclass(frozen=True)
class Host:
    """A kind of machine as the reader of its effects knows it.

    `places`: where terms may enter, none for a model without formulas; a place in `targeted`
    may be followed by the name of one input or sensor. `reserved`: names that formulas have
    a meaning for.
    """

    kind: str
    places: tuple[str, ...]
    targeted: frozenset[str]
    reserved: frozenset[str]


def read_effects(root: Value, host: Host) -> tuple[WrittenEffect, ...]:
    """The `[[effect]]` sections of a file; faults are noted at their places."""
    entries = root.sections("effect")
    made = [
        found
        for entry in entries
        if (found := entry.need("name", _effect_at(entry, host), "no name of an effect"))
    ]
    seen = set()
    for effect in made:
        if (effect.name, effect.form) in seen and effect.value is not None:
            effect.value.report(f"two effects are called {shown(effect.name)}", "double-name")
        seen.add((effect.name, effect.form))
    if len(entries) > MOST_EFFECTS:
        root.report(f"more than {MOST_EFFECTS} effects", "too-large", at="effect")
    return tuple(made)


def _effect_at(entry: Value, host: Host) -> Callable[[Value], WrittenEffect]:
    return lambda _: read_effect(entry, host, {}, own=True)


def read_effect(entry: Value, host: Host, units: Mapping[str, str], own: bool) -> WrittenEffect:
    """An effect; `units` are those that stand for `{x}` and the like in the catalogue.

    One that is not a user's `own` may state `of`, the variable of a free-form term.
    """
    before = entry.faults
    name = text()(entry["name"])
    if not _EFFECT_NAME.fullmatch(name) or name == "base":
        entry.report("expected a name of at most 60 characters, and not base", at="name")
    enters, target = "", ""
    term = Written.of("0")
    if host.places:
        enters, target = entry.need("enters", _enters(host), f"{shown(name)} enters nowhere") or (
            "", "",
        )  # fmt: skip
        term = entry.need("formula", read_formula, f"{shown(name)} has no formula") or term
    keys = _EFFECT_KEYS if own else _EFFECT_KEYS | {"of"}
    parameters = tuple(
        made
        for key in entry.data
        if key not in keys and (made := entry.get(key, _parameter(units, host, own, term), None))
    )
    if not any(p.role == "amplitude" for p in parameters) and entry.faults == before:
        entry.report(f"{shown(name)} has no parameter that is an amplitude", "missing-key")
    if len(parameters) > MOST_PARAMETERS:
        entry.report(f"more than {MOST_PARAMETERS} parameters", "too-large")
    form, extends = (entry.get(key, text(empty=True), None) for key in ("form", "extends"))
    if entry.faults > before:
        raise Refused
    flags = ("driven", *_OF_AXES, "unconfirmed")
    driven, rotary, angular, unconfirmed = (entry.get(key, flag, False) for key in flags)
    of = "" if own else entry.get("of", text(), "")
    return WrittenEffect(
        name,
        enters,
        target,
        term,
        parameters,
        form or "",
        extends,
        own,
        driven,
        rotary,
        of,
        entry,
        angular,
        unconfirmed=unconfirmed,
    )


def _enters(host: Host) -> Callable[[Value], tuple[str, str]]:
    def read(value: Value) -> tuple[str, str]:
        place, _, target = text()(value).partition(" ")
        if place not in host.places or (target and place not in host.targeted):
            listed = ", ".join(host.places)
            message = f"expected enters: one of {listed}, for a machine of kind {host.kind}"
            raise value.refused(message)
        return place, target

    return read


def read_formula(value: Value, of: str = "a formula") -> Written:
    """A formula; refused at the character that is wrong."""
    stated = text(message=f"expected {value.key}: {of}")(value)
    try:
        return Written(parse(stated), value)
    except FormulaError as error:
        found = value.error_inside(str(error), error.start, error.end, "bad-formula")
        raise value.include(found) from error


def read_unit(value: Value) -> str:
    """A unit that there is, such as `N s/m`."""
    try:
        unit = text(message=f"expected {value.key}: a unit")(value)
        dimension_of_unit(unit)
    except UnitError as error:
        raise value.refused(f"{value.key}: {error}", "wrong-unit") from error
    return unit


def inline(value: Value, form: str) -> Value:
    """The value, if it is a table in one line, which is how a repaired file states it."""
    if not isinstance(value.data, dict):
        raise value.refused(f"expected {value.key} = {form}")
    return value


def check_name(value: Value, reserved: frozenset[str]) -> None:
    """Note a key that is no name, or has a meaning in formulas already."""
    taken = reserved | FUNCTIONS.keys() | SIGNALS.keys()
    if not _NAME.fullmatch(value.key):
        value.report(f"{value.key} is no name: letters, digits and _ only", "bad-name")
    elif value.key in taken:
        message = f"the name {value.key} has a meaning in formulas already: expected another one"
        value.report(f"{message}, such as {value.key}_1", "bad-name")


# -- parameters --------------------------------------------------------------------------


def _role_in(term: Written, name: str) -> str:
    """The role of a parameter that states none: where it only divides, the effect is not off at 0.

    There it is the period of a sine or cosine, or another shape.
    """
    if not term.formula.only_within(name, ["/"]):
        return AMPLITUDE
    return PERIOD if term.formula.only_within(name, ["sin", "cos"]) else SHAPE


def _parameter(
    units: Mapping[str, str], host: Host, own: bool, term: Written
) -> Callable[[Value], EffectParameter]:
    def read(value: Value) -> EffectParameter:
        table = inline(value, '{ unit = "..." }')
        table.only(_PARAMETER_KEYS)
        check_name(value, host.reserved)
        unit = _template(table["unit"], units) if "unit" in table else ""
        if not unit:
            raise value.refused(f"{value.key} has no unit", "missing-key")
        role = table.get("role", one_of(*ROLES), _role_in(term, value.key))
        low, high = table.get("range", _sizes, (None, None))
        start = table.get("start", _size, None)
        positive = table.get("positive", flag, False)
        place = value if own else None
        return EffectParameter(value.key, unit, role, low, high, start, positive, place)

    return read


def _template(value: Value, units: Mapping[str, str]) -> str:
    """The unit, or the product of a list of units; `{x}` and the like in them are of `units`."""
    if not isinstance(value.data, list) and not units:
        return read_unit(value)
    try:
        if isinstance(value.data, list):
            return product(*(_filled(part, units) for part in value.data))
        filled = _filled(value.data, units)
        dimension_of_unit(filled)
    except (KeyError, TypeError, UnitError) as error:
        message = f"{value.key}: expected a unit or a list of units"
        raise value.refused(message, "wrong-unit") from error
    return filled


def _filled(unit: str, units: Mapping[str, str]) -> str:
    return _PLACE.sub(lambda found: units[found[1]], unit)


def read_range(value: Value) -> tuple[float, float]:
    """Two numbers, the lower one first."""
    ends = [number_in(end) for end in value.data] if isinstance(value.data, list) else []
    match ends:
        case [float() as low, float() as high] if low < high:
            return low, high
    raise value.refused(f"expected {value.key} = [lowest, highest]")


def _sizes(value: Value) -> tuple[float | Formula, float | Formula]:
    if not isinstance(value.data, list) or len(value.data) != 2:
        raise value.refused(f"expected {value.key} = [lowest, highest]")
    low, high = (_size_of(value, end) for end in value.data)
    if isinstance(low, float) and isinstance(high, float) and not low < high:
        raise value.refused(f"expected {value.key} = [lowest, highest]")
    return low, high


def _size(value: Value) -> float | Formula:
    return _size_of(value, value.data)


def _size_of(value: Value, data: Any) -> float | Formula:
    number = number_in(data)
    if number is not None:
        return number
    if not isinstance(data, str):
        raise value.refused(f"expected {value.key}: numbers")
    try:
        return parse(data)
    except FormulaError as error:
        raise value.refused(f"{value.key}: {error}", "bad-formula") from error
