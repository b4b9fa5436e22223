"""Machine files of kinds other than the motor, and the effects in them and in the catalogue."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from mopro.errors import Diagnostic, ModelError
from mopro.formula import Formula, FormulaError, UnitError, dimension_of_unit, parse, product
from mopro.formula.language import FUNCTIONS, PI, SIGNALS
from mopro.rig.model import (
    AXIS,
    ENTERS,
    INPUT,
    KINDS,
    KINEMATIC,
    MEASUREMENT,
    PYTHON,
    ROLES,
    THERMAL,
    Effect,
    EffectParameter,
    Number,
    Rig,
    Written,
)  # fmt: skip
from mopro.source import Source, Span
from mopro.tomlfile import Document, Refused, Value, read_source, shown
from mopro.tomlfile.schema import flag, number_in, one_of, table_in, text

T = TypeVar("T")
_FOLDER = Path(__file__).with_name("catalogue")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}")
_EFFECT_NAME = re.compile(r"[^\W][^\n\"]{0,59}")
_EFFECT_KEYS = {"name", "enters", "formula", "form", "extends", "driven"}
_PARAMETER_KEYS = {"unit", "range", "start", "role", "positive"}
_NUMBER_KEYS = {"value", "unit", "free", "tolerance", "range", "before", "origin", "place"}
_TOP_KEYS = {"kind", "name", "base", "effect", "effects"}
_OF_KIND = {
    KINEMATIC: {"unit", "position"},
    AXIS: {"unit", "acceleration"},
    THERMAL: {"nodes"},
    PYTHON: {"python"},
}
# Names that formulas of a kind know already.
_IN_MOTION = frozenset({"t", "x", "v", "a", "y", "u", PI})
RESERVED = {
    KINEMATIC: _IN_MOTION,
    AXIS: _IN_MOTION,
    THERMAL: frozenset({"t", "T", "y", "u", "ambient", "exchange", "foreign", PI}),
    PYTHON: frozenset(),
}
MOST_NUMBERS, MOST_EFFECTS, MOST_PARAMETERS = 40, 60, 8
# The range of a free number without one, in its value.
_LOWEST, _HIGHEST = 0.1, 10.0


def kind_of(name_or_path: str | Path) -> str | None:
    """The kind that a machine file states, or the kind that is named; None for the motor."""
    if str(name_or_path) in KINDS:
        return str(name_or_path)
    try:
        kind = Document(read_source(name_or_path)).root.data.get("kind")
    except ModelError:
        return None
    return kind if isinstance(kind, str) and kind != "sawyer" else None


def load_rig(name_or_path: str | Path) -> Rig:
    """The machine of that file, or a bare kinematic one; ModelError with all findings.

    Other kinds have numbers or formulas that only a file can state.
    """
    if str(name_or_path) == KINEMATIC:
        kind = str(name_or_path)
        return read_rig(Source(kind, f'kind = "{kind}"\nname = "{kind}"\n'), bare=True)
    if str(name_or_path) in KINDS:
        source = Source(str(name_or_path), "")
        message = f"a machine of kind {name_or_path} needs a file: its numbers are not known"
        hint = f'write one with kind = "{name_or_path}"; docs/machines.md has examples'
        raise ModelError(source, [Diagnostic("no-numbers", message, Span(1, 1, 1), hint=hint)])
    return read_rig(read_source(name_or_path))


def read_rig(source: Source, bare: bool = False) -> Rig:
    """The machine that `source` describes; ModelError with all findings."""
    return Document(source).read(lambda root: _rig(root, source, bare))


def _rig(root: Value, source: Source, bare: bool) -> Rig:
    kind = root.need("kind", one_of(*KINDS), "expected a kind")
    if kind is None:
        raise Refused
    root.only(_TOP_KEYS | _OF_KIND[kind])
    before = root.faults
    name = root.need("name", text(), 'expected a name, such as name = "mine"') or ""
    unit = root.get("unit", _axis_unit, "")
    numbers = _numbers(root["base"], kind) if "base" in root else {}
    laws = _laws(root, kind, unit, numbers) if not bare else _bare_laws(kind)
    effects = tuple(
        made for entry in root.sections("effect") if (made := _own_effect(entry, kind)) is not None
    )
    _check_distinct(root, effects)
    if len(effects) > MOST_EFFECTS:
        root.report(f"more than {MOST_EFFECTS} effects", "too-large", at="effect")
    python = root.need("python", _callable, _NO_PYTHON) if kind == PYTHON else None
    active = root.get("effects", _active, {})
    if root.faults > before:
        raise Refused
    return Rig(name, kind, unit, numbers, laws, effects, active, source, python)


_NO_PYTHON = 'expected python = "model.py:simulate"'


def _callable(value: Value) -> tuple[str, str]:
    stated = text(message=_NO_PYTHON)(value)
    file, _, function = stated.rpartition(":")
    if not file.endswith(".py") or not function.isidentifier():
        raise value.refused(_NO_PYTHON)
    return file, function


def _axis_unit(value: Value) -> str:
    unit = _unit(value)
    if dimension_of_unit(unit) not in _AXIS_DIMENSIONS:
        raise value.refused("expected a unit of a length, an angle or count", "wrong-unit")
    return unit


_AXIS_DIMENSIONS = tuple(map(dimension_of_unit, ("m", "rad", "count")))


def _unit(value: Value) -> str:
    try:
        unit = text(message=f"expected {value.key}: a unit")(value)
        dimension_of_unit(unit)
    except UnitError as error:
        raise value.refused(f"{value.key}: {error}", "wrong-unit") from error
    return unit


# -- numbers -----------------------------------------------------------------------------


def _numbers(section: Value, kind: str) -> dict[str, Number]:
    table = table_in(section)
    if len(table.data) > MOST_NUMBERS:
        raise table.refused(f"more than {MOST_NUMBERS} numbers", "too-large")
    for entry in table.values():
        check_name(entry, kind)
    found = {entry.key: section.get(entry.key, _number, None) for entry in table.values()}
    return {name: number for name, number in found.items() if number is not None}


def _number(value: Value) -> Number:
    table = _inline(value, "{ value = 1.0, unit = ... }")
    table.only(_NUMBER_KEYS)
    unit = table.need("unit", _unit, f"{value.key} has no unit") or "1"
    number = number_in(table.data.get("value"))
    free = table.get("free", flag, False)
    tolerance = table.get("tolerance", _share, 0.0)
    if number is None:
        raise value.refused(f"expected {value.key} = {{ value = number, unit = ... }}")
    if free and tolerance:
        value.report(f"{value.key} is free, and has a tolerance: state one of them")
    low, high = table.get("range", _range, (None, None))
    if low is None or high is None:
        low, high = sorted((_LOWEST * number, _HIGHEST * number))
        if free and low == high:
            raise value.refused(f"{value.key} is free: expected range = [lowest, highest]")
    if free and not low <= number <= high:
        value.report(f"{value.key} is outside of its range")
    before = number_in(table.data.get("before"))
    return Number(value.key, unit, number, free, tolerance, low, high, before)


def _inline(value: Value, form: str) -> Value:
    """The value, if it is a table in one line, which is how a repaired file states it."""
    if not isinstance(value.data, dict):
        raise value.refused(f"expected {value.key} = {form}")
    return value


def check_name(value: Value, kind: str) -> None:
    """Note a name that is none, or that formulas of a kind know already."""
    taken = RESERVED[kind] | FUNCTIONS.keys() | SIGNALS.keys()
    if not _NAME.fullmatch(value.key):
        value.report(f"{value.key} is no name: letters, digits and _ only", "bad-name")
    elif value.key in taken:
        value.report(f"the name {value.key} has a meaning in formulas already", "bad-name")


def _share(value: Value) -> float:
    number = number_in(value.data)
    if number is None or not 0 <= number < 1:
        raise value.refused(f"expected {value.key} as a share, such as 0.1")
    return number


def _range(value: Value) -> tuple[float, float]:
    ends = [number_in(end) for end in value.data] if isinstance(value.data, list) else []
    match ends:
        case [float() as low, float() as high] if low < high:
            return low, high
    raise value.refused(f"expected {value.key} = [lowest, highest]")


# -- laws --------------------------------------------------------------------------------


def _written(value: Value) -> Written:
    stated = text(message=f"expected {value.key}: a formula")(value)
    try:
        return Written(parse(stated), value)
    except FormulaError as error:
        found = value.error_inside(str(error), error.start, error.end, "bad-formula")
        raise value.include(found) from error


def _laws(root: Value, kind: str, unit: str, numbers: Mapping[str, Number]) -> dict[str, Written]:
    if kind == THERMAL:
        nodes = root.need(
            "nodes", _nodes, 'expected [nodes], such as heater = "-U * (T - ambient)"'
        )
        return nodes or {}
    if kind == AXIS and "acceleration" not in root and not numbers.keys() & {"mass", "inertia"}:
        root.report("expected a mass or an inertia in [base], or acceleration = formula",
                    "missing-key")  # fmt: skip
    if kind == AXIS and not unit and "unit" not in root:
        root.report('expected the unit of the axis, such as unit = "mm"', "missing-key")
    key = "position" if kind == KINEMATIC else "acceleration"
    law = root.get(key, _written, None)
    return {key: law} if law is not None else _bare_laws(kind)


def _bare_laws(kind: str) -> dict[str, Written]:
    return {"position": Written.of("command")} if kind == KINEMATIC else {}


def _nodes(section: Value) -> dict[str, Written]:
    table = table_in(section)
    if not table.data:
        raise table.refused('expected nodes, such as heater = "-U * (T - ambient)"')
    for entry in table.values():
        check_name(entry, THERMAL)
    laws = {entry.key: table.get(entry.key, _written, None) for entry in table.values()}
    return {name: law for name, law in laws.items() if law is not None}


# -- effects -----------------------------------------------------------------------------


def _own_effect(entry: Value, kind: str) -> Effect | None:
    return entry.need("name", lambda _: _effect(entry, kind, {}, own=True), "no name of an effect")


def _effect(entry: Value, kind: str, units: Mapping[str, str], own: bool) -> Effect:
    """An effect; `units` are those that stand for `{x}` and the like in the catalogue."""
    before = entry.faults
    name = text()(entry["name"])
    if not _EFFECT_NAME.fullmatch(name) or name == "base":
        entry.report("expected a name of at most 60 characters, and not base", at="name")
    enters, target = "", ""
    term = Written.of("0")
    if kind != PYTHON:
        enters, target = entry.need("enters", _enters(kind), f"{shown(name)} enters nowhere") or (
            "", "",
        )  # fmt: skip
        term = entry.need("formula", _written, f"{shown(name)} has no formula") or term
    parameters = tuple(
        made
        for key in entry.data
        if key not in _EFFECT_KEYS and (made := entry.get(key, _parameter(units, kind), None))
    )
    if not any(p.role == "amplitude" for p in parameters) and entry.faults == before:
        entry.report(f"{shown(name)} has no parameter that is an amplitude", "missing-key")
    if len(parameters) > MOST_PARAMETERS:
        entry.report(f"more than {MOST_PARAMETERS} parameters", "too-large")
    form, extends = (entry.get(key, text(empty=True), None) for key in ("form", "extends"))
    if entry.faults > before:
        raise Refused
    driven = entry.get("driven", flag, False)
    return Effect(name, enters, target, term, parameters, form or "", extends, own, driven, entry)


def _enters(kind: str) -> Callable[[Value], tuple[str, str]]:
    def read(value: Value) -> tuple[str, str]:
        place, _, target = text()(value).partition(" ")
        if place not in ENTERS[kind] or (target and place not in (INPUT, MEASUREMENT)):
            listed = ", ".join(ENTERS[kind])
            raise value.refused(f"expected enters: one of {listed}, for a machine of kind {kind}")
        return place, target

    return read


def _parameter(units: Mapping[str, str], kind: str) -> Callable[[Value], EffectParameter]:
    def read(value: Value) -> EffectParameter:
        table = _inline(value, '{ unit = "..." }')
        table.only(_PARAMETER_KEYS)
        check_name(value, kind)
        unit = _template(table["unit"], units) if "unit" in table else ""
        if not unit:
            raise value.refused(f"{value.key} has no unit", "missing-key")
        role = table.get("role", one_of(*ROLES), ROLES[0])
        low, high = table.get("range", _sizes, (None, None))
        start = table.get("start", _size, None)
        positive = table.get("positive", flag, False)
        return EffectParameter(value.key, unit, role, low, high, start, positive)

    return read


def _template(value: Value, units: Mapping[str, str]) -> str:
    """The unit, or the product of a list of units with `{x}` and the like in them."""
    if not isinstance(value.data, list):
        filled = value.data.format(**units) if units and isinstance(value.data, str) else None
        return filled or _unit(value)
    return product(*(part.format(**units) for part in value.data))


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


def _check_distinct(root: Value, effects: tuple[Effect, ...]) -> None:
    seen = set()
    for effect in effects:
        if (effect.name, effect.form) in seen and effect.value is not None:
            effect.value.report(f"two effects are called {shown(effect.name)}", "double-name")
        seen.add((effect.name, effect.form))


def _active(section: Value) -> dict[str, dict[str, float]]:
    table = table_in(section)
    return {entry.key: _values(entry) for entry in table.values()}


def _values(section: Value) -> dict[str, float]:
    found = {}
    for entry in table_in(section).values():
        number = number_in(entry.data.get("value") if isinstance(entry.data, dict) else entry.data)
        if number is None:
            section.report(f"expected {entry.key}: a number, or {{ value, unit }}", at=entry.key)
        else:
            found[entry.key] = number
    return found


# -- the catalogue -----------------------------------------------------------------------


@cache
def catalogue(kind: str, units: tuple[tuple[str, str], ...]) -> tuple[Effect, ...]:
    """The effects that are listed for a kind, in the units `{x}`, `{force}` or `{power}`."""
    file = _FOLDER / f"{kind}.toml"
    if not file.exists():
        return ()
    root = Document(Source(file.name, file.read_text("utf-8"))).root
    return tuple(_effect(entry, kind, dict(units), own=False) for entry in root.sections("effect"))
