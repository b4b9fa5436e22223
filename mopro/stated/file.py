"""Files of stated machines, and the effects in them and in the catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from mopro.errors import Diagnostic, ModelError
from mopro.formula import dimension_of_unit, product
from mopro.formula.dimension import factor_of
from mopro.formula.entry import (
    Host,
    check_name,
    inline,
    read_effect,
    read_effects,
    read_formula,
    read_range,
    read_unit,
)
from mopro.formula.expressions import PI
from mopro.formula.written import MEASUREMENT, Written, WrittenEffect
from mopro.instruments.quantity import AXIS_UNITS
from mopro.machine.run_effects import read_runs, states_runs
from mopro.source import Source, Span
from mopro.stated.model import (
    AXIS,
    ENTERS,
    INPUT,
    KINDS,
    KINEMATIC,
    PYTHON,
    THERMAL,
    Number,
    StatedMachine,
)
from mopro.tomlfile import Document, Refused, Value, read_source
from mopro.tomlfile.schema import flag, number_in, one_of, table_in, text

# Assumed: no number of a machine is known to better than this share of it. A tolerance that is
# less as a share, and more in the unit of the number, is in that unit.
_FINEST = 1e-3
_DOUBT = (
    "a tolerance of {0:g} is taken in {1}, {2:.3g} of the number, as hardly any is known to such a "
    'share: state tolerance = {2:.3g}, or {{ value = {0:g}, unit = "{1}" }}'
)
_EXPECTED = "expected {} as a share, such as 0.1"


def tolerance_of(number: float, unit: str) -> Callable[[Value], tuple[float, str]]:
    """Reader of the tolerance of `number`: as a share of it, and a note on a doubtful one."""

    def read(value: Value) -> tuple[float, str]:
        if isinstance(value.data, dict):
            return _in_its_unit(value, number, unit), ""
        stated = number_in(value.data)
        if stated is None or stated < 0:
            raise value.refused(_EXPECTED.format(value.key))
        of_number = stated / abs(number) if number else math.inf
        if stated < 1 and not (0 < stated < _FINEST <= of_number < 1):
            return stated, ""
        if not of_number < 1:
            raise value.refused(_EXPECTED.format(value.key))
        return of_number, _DOUBT.format(stated, unit, of_number)

    return read


def _in_its_unit(value: Value, number: float, unit: str) -> float:
    """The share of `number` that a tolerance with a unit of its own is."""
    table = inline(value, f'{{ value = 0.1, unit = "{unit}" }}')
    table.only({"value", "unit"})
    stated, own = number_in(table.data.get("value")), table.need("unit", read_unit, "no unit")
    if stated is None or stated < 0 or own is None:
        raise value.refused(f'expected {{ value = 0.1, unit = "{unit}" }}')
    if dimension_of_unit(own) != dimension_of_unit(unit):
        raise value.refused(f"the number is in {unit}, and its tolerance in {own}", "wrong-unit")
    share = stated * factor_of(own) / (abs(number) * factor_of(unit)) if number else math.inf
    if not share < 1:
        raise value.refused("the tolerance is as large as the number: state it free")
    return share


# Of a kinematic machine whose effort is measured over a known motion.
EFFORT = "_effort"
_FOLDER = Path(__file__).with_name("catalogue")
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
_TARGETED = frozenset({INPUT, MEASUREMENT})
_RESERVED = {
    KINEMATIC: _IN_MOTION,
    AXIS: _IN_MOTION,
    THERMAL: frozenset({"t", "T", "y", "u", "ambient", "exchange", "in_first", "foreign", PI}),
    PYTHON: frozenset(),
}
HOSTS = {kind: Host(kind, ENTERS[kind], _TARGETED, _RESERVED[kind]) for kind in KINDS}
MOST_NUMBERS = 40
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


def load_stated(name_or_path: str | Path) -> StatedMachine:
    """The machine of that file, or a bare kinematic one; ModelError with all findings.

    Other kinds have numbers or formulas that only a file, or an experiment's data, can state.
    """
    if str(name_or_path) == KINEMATIC:
        kind = str(name_or_path)
        return read_stated(Source(kind, f'kind = "{kind}"\nname = "{kind}"\n'), kind_only=True)
    if str(name_or_path) in KINDS:
        source = Source(str(name_or_path), "")
        message = f"{name_or_path} is a kind, and has no numbers without an experiment"
        hint = f"write a file with: mopro machine new mine.toml --from {name_or_path}"
        raise ModelError(source, [Diagnostic("no-numbers", message, Span(1, 1, 1), hint=hint)])
    return read_stated(read_source(name_or_path))


def read_stated(source: Source, kind_only: bool = False) -> StatedMachine:
    """The machine that `source` describes; ModelError with all findings."""
    return Document(source).read(lambda root: _stated(root, source, kind_only))


def _stated(root: Value, source: Source, kind_only: bool) -> StatedMachine:
    kind = root.need("kind", one_of(*KINDS), "expected a kind")
    if kind is None:
        raise Refused
    root.only(_TOP_KEYS | _OF_KIND[kind])
    before = root.faults
    name = root.need("name", text(), 'expected a name, such as name = "mine"') or ""
    unit = root.get("unit", _axis_unit, "")
    numbers = _numbers(root["base"], kind) if "base" in root else {}
    if kind == AXIS and unit:
        _check_inertia(root, unit, numbers)
    laws = _laws(root, kind, unit, numbers) if not kind_only else _default_laws(kind)
    effects = read_effects(root, HOSTS[kind])
    python = root.need("python", _callable, _NO_PYTHON) if kind == PYTHON else None
    active = root.get("effects", _active, {})
    runs = root.get("effects", _runs, {}) if active else {}
    units = root.get("effects", _units, {}) if active else {}
    if root.faults > before:
        raise Refused
    return StatedMachine(
        name, kind, unit, numbers, laws, effects, active, source, python, runs, units=units
    )


_NO_PYTHON = 'expected python = "model.py:simulate"'


def _callable(value: Value) -> tuple[str, str]:
    stated = text(message=_NO_PYTHON)(value)
    file, _, function = stated.rpartition(":")
    if not file.endswith(".py") or not function.isidentifier():
        raise value.refused(_NO_PYTHON)
    return file, function


def _axis_unit(value: Value) -> str:
    unit = read_unit(value)
    if dimension_of_unit(unit) not in _AXIS_DIMENSIONS:
        raise value.refused("expected a unit of a length, an angle, count or V", "wrong-unit")
    return unit


_AXIS_DIMENSIONS = tuple(map(dimension_of_unit, AXIS_UNITS))


# -- numbers -----------------------------------------------------------------------------


def _numbers(section: Value, kind: str) -> dict[str, Number]:
    table = table_in(section)
    if len(table.data) > MOST_NUMBERS:
        raise table.refused(f"more than {MOST_NUMBERS} numbers", "too-large")
    for entry in table.values():
        check_name(entry, _RESERVED[kind])
    found = {entry.key: section.get(entry.key, _number, None) for entry in table.values()}
    return {name: number for name, number in found.items() if number is not None}


def _number(value: Value) -> Number:
    table = inline(value, "{ value = 1.0, unit = ... }")
    table.only(_NUMBER_KEYS)
    unit = table.need("unit", read_unit, f"{value.key} has no unit") or "1"
    number = number_in(table.data.get("value"))
    free = table.get("free", flag, False)
    if number is None:
        raise value.refused(f"expected {value.key} = {{ value = number, unit = ... }}")
    tolerance, note = table.get("tolerance", tolerance_of(number, unit), (0.0, ""))
    if free and tolerance:
        value.report(f"{value.key} is free, and has a tolerance: state one of them")
    low, high = table.get("range", read_range, (None, None))
    if low is None or high is None:
        low, high = sorted((_LOWEST * number, _HIGHEST * number))
        if free and low == high:
            raise value.refused(f"{value.key} is free: expected range = [lowest, highest]")
    if free and not low <= number <= high:
        value.report(f"{value.key} is outside of its range")
    before = number_in(table.data.get("before"))
    return Number(value.key, unit, number, free, tolerance, low, high, before, note)


def _check_inertia(root: Value, unit: str, numbers: Mapping[str, Number]) -> None:
    """Report a mass or an inertia whose product with an acceleration of the axis is no force."""
    for name, force in (("mass", "N"), ("inertia", "N m")):
        own = numbers.get(name)
        made = own and dimension_of_unit(product(own.unit, unit, "1/s2"))
        if own and made != dimension_of_unit(force):
            root["base"][name].report(
                f"{name} is in {own.unit}: times an acceleration in {unit}/s2 it is not in {force}",
                "wrong-unit", hint="an axis has a mass in kg, one that turns an inertia in kg m2",
            )  # fmt: skip


# -- laws --------------------------------------------------------------------------------


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
    law = root.get(key, read_formula, None)
    return {key: law} if law is not None else _default_laws(kind)


def _default_laws(kind: str) -> dict[str, Written]:
    return {"position": Written.of("command")} if kind == KINEMATIC else {}


def _nodes(section: Value) -> dict[str, Written]:
    table = table_in(section)
    if not table.data:
        raise table.refused('expected nodes, such as heater = "-U * (T - ambient)"')
    for entry in table.values():
        check_name(entry, _RESERVED[THERMAL])
    laws = {entry.key: table.get(entry.key, read_formula, None) for entry in table.values()}
    return {name: law for name, law in laws.items() if law is not None}


def _active(section: Value) -> dict[str, dict[str, float]]:
    table = table_in(section)
    return {entry.key: _values(entry) for entry in table.values()}


def _values(section: Value) -> dict[str, float]:
    found = {}
    for entry in table_in(section).values():
        if states_runs(entry):
            continue
        number = number_in(entry.data.get("value") if isinstance(entry.data, dict) else entry.data)
        if number is None:
            section.report(f"expected {entry.key}: a number, or {{ value, unit }}", at=entry.key)
        else:
            found[entry.key] = number
    return found


def _units(section: Value) -> dict[str, dict[str, str]]:
    """The units in which parameters of effects are stated, by the names of both."""
    return {
        effect.key: {
            entry.key: read_unit(entry["unit"])
            for entry in effect.values()
            if isinstance(entry.data, dict) and "value" in entry.data and "unit" in entry.data
        }
        for effect in table_in(section).values()
    }


def _runs(section: Value) -> dict[str, dict[str, str]]:
    """The runs of the effects that state them: names of data files, and their checksums."""
    return {
        effect.key: read_runs(entry)
        for effect in table_in(section).values()
        for entry in effect.values()
        if states_runs(entry)
    }


# -- the catalogue -----------------------------------------------------------------------


@cache
def catalogue(
    kind: str, units: tuple[tuple[str, str], ...], of: str = ""
) -> tuple[WrittenEffect, ...]:
    """The effects that are listed for a kind, in the units `{x}`, `{force}` or `{power}`.

    Of a kinematic machine those in its place, or with `of` = EFFORT those in the effort.
    """
    return _effects_in(_FOLDER / f"{kind}{of}.toml", HOSTS[kind], units)


@cache
def unlisted_terms(kind: str, units: tuple[tuple[str, str], ...]) -> tuple[WrittenEffect, ...]:
    """The free-form terms in the equations of a kind, beside the listed effects."""
    return _effects_in(_FOLDER / f"{kind}_unlisted.toml", HOSTS[kind], units)


def _effects_in(
    file: Path, host: Host, units: tuple[tuple[str, str], ...]
) -> tuple[WrittenEffect, ...]:
    if not file.exists():
        return ()
    root = Document(Source(file.name, file.read_text("utf-8"))).root
    entries = root.sections("effect")
    return tuple(read_effect(entry, host, dict(units), own=False) for entry in entries)
