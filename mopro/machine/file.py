"""Machine files: TOML in which each value states its unit and its origin."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import Field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mopro.machine.model import (
    Axis,
    Drive,
    Forcers,
    Heat,
    Limits,
    Machine,
    Platen,
    Provenance,
    StatedEffect,
    StatedValue,
    rate_fault,
    travel_faults,
)
from mopro.machine.run_effects import RUNS, read_runs, states_runs
from mopro.program import AXES
from mopro.source import Source
from mopro.tomlfile import Document, Refused, Value, read_named, shown
from mopro.tomlfile.schema import Reader, number_in, one_of, record, table_in, text
from mopro.units import to_si, units_of

if TYPE_CHECKING:
    from mopro.formula.written import WrittenEffect

VERDICTS = ("named", "ambiguous", "none", "unexplained")
ORIGINS = ("thesis", "derived", "assumed", "measured")
_SECTIONS: dict[str, type[Any]] = {"axis": Axis, "drive": Drive, "platen": Platen, "heat": Heat}
_OPTIONAL: dict[str, type[Any]] = {"forcers": Forcers, "limits": Limits}
_EFFECTS = "effects"
_FORMULAS = "effect"
_EXTENDS = "extends"
_VERDICT = "verdict"
# Beside this file in a checkout and when installed; importlib.resources takes longer to
# import than the machine takes to read.
_FOLDER = Path(__file__).with_name("machines")
_TEMPLATES = Path(__file__).with_name("templates")
_VALUE_KEYS = {"value", "unit", "origin", "place"}
_TOLERANCE = "tolerance"


def builtin_machines() -> list[str]:
    """The names that `load_machine` knows without a file."""
    folder = _FOLDER
    return sorted(
        p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml")
    )


@cache
def _builtin(name: str) -> Machine:
    return read_machine(Source(f"{name}.toml", _builtin_text(name)))


def _builtin_text(name: str) -> str:
    return (_FOLDER / f"{name}.toml").read_text("utf-8")


def templates() -> list[str]:
    """The names that `template` knows: built-in machines, and kinds of machine."""
    kinds = (p.name.removesuffix(".toml") for p in _TEMPLATES.iterdir() if p.suffix == ".toml")
    return [*builtin_machines(), *sorted(kinds)]


def template(name: str) -> str:
    """The text of a commented machine file to begin with; its name is `NAME`."""
    if name in builtin_machines():
        lines = _builtin_text(name).splitlines(keepends=True)
        return "".join('name = "NAME"\n' if x.startswith("name =") else x for x in lines)
    return (_TEMPLATES / f"{name}.toml").read_text("utf-8")


def load_machine(name_or_path: str) -> Machine:
    """The built-in machine of that name, or the one in that file; else ModelError."""
    if name_or_path in builtin_machines():
        return _builtin(name_or_path)
    return read_machine(read_named("machine", name_or_path, builtin_machines()))


def read_machine(source: Source) -> Machine:
    """The machine that `source` describes; ModelError with all findings, by line."""
    return Document(source).read(partial(_machine, source=source))


def _machine(root: Value, source: Source) -> Machine:
    before = root.faults
    root.only({"name", "kind", _EXTENDS, _VERDICT, _EFFECTS, _FORMULAS, *_SECTIONS, *_OPTIONAL})
    if _EXTENDS in root:
        root = _extended(root, source)
    root.get("kind", one_of("sawyer"), "sawyer")
    missing = 'expected a name, such as name = "mine"'
    name = root.need("name", text(message=missing, rule="missing-key"), missing)
    parts: dict[str, Any] = {
        key: root.need(key, record(kind, _reader_of), f"expected a section [{key}]")
        for key, kind in (_SECTIONS | _OPTIONAL).items()
        if key in _SECTIONS or key in root
    }
    verdict = root.get(_VERDICT, one_of(*VERDICTS), None)
    effects = root.get(_EFFECTS, _effects, ())
    formulas = formulas_in(root)
    if root.faults > before:
        raise Refused
    _check_rate(root["axis"], parts["axis"])
    _check_travel(root["platen"], parts["platen"], parts["heat"].forcer_side_m)
    return Machine(
        name=str(name),
        provenance=_provenance(root),
        effects=effects,
        formulas=formulas,
        verdict=verdict,
        source=source,
        **parts,
    )


def formulas_in(root: Value) -> tuple[WrittenEffect, ...]:
    """The effects that a file states as formulas; faults are noted at their places."""
    if _FORMULAS not in root:
        return ()
    from mopro.machine.formulas import read_formulas  # few files have any

    return read_formulas(root)


def _extended(root: Value, source: Source) -> Value:
    """The file with all that it does not state taken from the built-in machine it extends."""
    names = builtin_machines()
    known = f"expected {_EXTENDS}: the name of a built-in machine, {', '.join(names)}"
    base = one_of(*names, message=known, rule="unknown-machine")(root[_EXTENDS])
    for key in (*_SECTIONS, *_OPTIONAL):
        if key in root:
            table_in(root[key])
    below = tomllib.loads(_builtin_text(base)) | {"name": Path(source.name).stem}
    return root.over(below)


# -- quantities --------------------------------------------------------------------


def _reader_of(part: Field[Any]) -> Reader[Any]:
    if choices := part.metadata.get("choices"):
        message = f"expected {part.metadata['key']} to be one of {', '.join(choices)}"
        return one_of(*choices, message=message)
    return partial(_quantity, part.metadata)


def _quantity(about: Mapping[str, Any], value: Value) -> float:
    """`{ value, unit, origin, place }` in SI, within its bound."""
    number = number_in(value.data.get("value")) if isinstance(value.data, dict) else None
    if number is None:
        form = "{ value = number, unit = ..., origin = ..., place = ... }"
        raise value.refused(f"expected {value.key} = {form}")
    _check_origin(value, about["tolerated"])
    found = _in_si(value, number, about["dimension"])
    low, high = about["low"], about["high"]
    if not low <= found <= high:
        unit = units_of(about["dimension"])[0]
        raise value.refused(f"{value.key} must be from {low:g} to {high:g} {unit}")
    return found


def _in_si(value: Value, number: float, dimension: str) -> float:
    try:
        return to_si(number, shown(value.data.get("unit")), dimension)
    except ValueError as error:
        value.report(f"{value.key}: {error}", "wrong-unit", at="unit")
        raise Refused from error


def _check_origin(value: Value, tolerated: bool) -> None:
    """Report faults of the keys other than value and unit."""
    value.only(_VALUE_KEYS | ({_TOLERANCE} if tolerated else set()))
    if value.data.get("origin") not in ORIGINS:
        message = f"expected an origin of {value.key}: one of {', '.join(ORIGINS)}"
        value.report(message, "missing-origin", at="origin")
    share = number_in(value.data.get(_TOLERANCE, 0.0))
    if tolerated and (share is None or not 0 <= share < 1):
        message = f"expected the tolerance of {value.key} as a share of it, such as 0.1"
        value.report(message, at=_TOLERANCE)


def _provenance(root: Value) -> dict[str, Provenance]:
    """Provenance of each value that states one, by `section.key`."""
    sections = [root[key] for key in (*_SECTIONS, *_OPTIONAL) if key in root]
    effects = root[_EFFECTS].values() if _EFFECTS in root else ()
    return {
        value.name: Provenance(
            str(value.data.get("origin")),
            str(value.data.get("place", "")),
            float(value.data.get(_TOLERANCE, 0.0)),
        )
        for section in (*sections, *effects)
        for value in section.values()
        if isinstance(value.data, dict) and not states_runs(value)
    }


# -- what a run cannot do ----------------------------------------------------------


def _check_rate(section: Value, axis: Axis) -> None:
    if fault := rate_fault(axis):
        message, hint = fault
        section.report(message, "too-fast", hint)


def _check_travel(section: Value, platen: Platen, forcer_side_m: float) -> None:
    for key, message in travel_faults(platen, forcer_side_m).items():
        section.report(message, "no-travel", at=key)


# -- effects -----------------------------------------------------------------------


def _effects(value: Value) -> tuple[StatedEffect, ...]:
    if not isinstance(value.data, dict):
        raise value.refused("expected sections such as [effects.NAME]")
    effects = [value.get(name, _effect, None) for name in value.data]
    return tuple(effect for effect in effects if effect is not None)


def _effect(table: Value) -> StatedEffect:
    if not isinstance(table.data, dict):
        raise table.refused(f"expected a section [{table.name}]")
    belongs = RUNS in table and states_runs(table[RUNS])
    others = {"axes", RUNS} if belongs else {"axes"}
    values = {key: table.get(key, _stated, None) for key in table.data if key not in others}
    return StatedEffect(
        table.key,
        {key: number for key, number in values.items() if number is not None},
        table.get("axes", _axes, AXES),
        table.span,
        table.get(RUNS, read_runs, {}) if belongs else {},
    )


def _axes(value: Value) -> tuple[int, ...]:
    axes = value.data
    if not isinstance(axes, list) or not axes or any(axis not in AXES for axis in axes):
        raise value.refused("expected axes such as [1] or [1, 2]")
    return tuple(axes)


def _stated(value: Value) -> StatedValue:
    """A bare number, or a table with value and unit."""
    number, unit = value.data, None
    if isinstance(value.data, dict):
        _check_origin(value, tolerated=False)
        number, unit = value.data.get("value"), shown(value.data.get("unit"))
    if isinstance(number, bool) or not isinstance(number, int | float):
        form = f"{value.key} = {{ value = number, unit = ... }}"
        raise value.refused(f"expected {value.key} = number, or {form}")
    return StatedValue(float(number), unit, value.span)
