"""Quantities tell all that code asks of them; no code asks which one it is."""

import ast
from pathlib import Path

import pytest

import mopro
from mopro.errors import DataError
from mopro.instruments.quantity import FORCE, POSITION, QUANTITIES, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.recording.record import column_names
from mopro.units import UNITS

PACKAGE = Path(mopro.__file__).parent
# The benchmark's reference plant and its cases share no code with mopro's sensors; the tables
# of the thesis have quantities of their own.
OTHERS = ("instruments", "blind", "thesis")
CONSTANTS = {name.upper() for name in QUANTITIES}
# Who makes sensors of the thesis' instruments names what they measure.
MAKERS = {"experiment/sawyer/raw.py", "emulator/instrument_files.py"}


@pytest.mark.parametrize("quantity", QUANTITIES.values(), ids=str)
def test_its_units_are_of_its_dimension_and_a_recording_has_its_column(quantity):
    assert {UNITS[suffix][0] for suffix in quantity.suffixes} == {quantity.dimension}
    assert quantity.recorded_column(2) in column_names([1, 2])
    assert quantity.of_axis == (quantity.recorded_column(1) != quantity.recorded_column(2))


@pytest.mark.parametrize(
    ("quantity", "column", "unit_si"),
    [(POSITION, "position_1_in", 0.0254), (TEMPERATURE, "temperature_C", 1.0),
     (FORCE, "force_1_N", 1.0), (FORCE, "force_1_lbf", 4.4482216152605)],
)  # fmt: skip
def test_a_sensor_s_column_has_a_unit_of_its_quantity(quantity, column, unit_si):
    sensor = Sensor("s", quantity, column, 10.0)
    assert sensor.unit_si == pytest.approx(unit_si, rel=1e-15)
    for other in QUANTITIES.values():
        if other != quantity:
            with pytest.raises(DataError, match=f"column {column} has no unit of a {other}"):
                _ = Sensor("s", other, column, 10.0).unit_si


@pytest.mark.parametrize(
    ("quantity", "shift"), [(POSITION, 2e-3), (FORCE, 2e-3 * 500.0)], ids=["position", "force"]
)
def test_a_steady_force_shows_as_a_deflection_or_as_itself(quantity, shift):
    assert quantity.under_load(2e-3, 500.0) == shift


# -- the code ---------------------------------------------------------------------


def is_a_constant(node, others):
    """True for a quantity by its constant; `others` are names that are imported from elsewhere."""
    named = isinstance(node, ast.Name) and node.id in CONSTANTS - others
    return named or (isinstance(node, ast.Attribute) and node.attr in CONSTANTS)


def imported_from_elsewhere(tree):
    """Names such as FORCE that mean another thing here, as where a formula enters a model."""
    return {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and not node.module.startswith("mopro.instruments")
        for alias in node.names
    }


def says_a_name(node):
    return any(isinstance(n, ast.Constant) and n.value in QUANTITIES for n in ast.walk(node))


def speaks_of_a_quantity(node):
    words = (getattr(n, "attr", getattr(n, "id", "")) for n in ast.walk(node))
    return any("quantit" in word for word in words)


def asks_which(tree):
    """Lines that compare with a quantity, by its object or by its name."""
    foreign = imported_from_elsewhere(tree)
    for node in ast.walk(tree):
        match node:
            case ast.Compare(left=left, comparators=others):
                sides = [left, *others]
            case ast.Match(subject=subject, cases=cases):
                sides = [subject, *(case.pattern for case in cases)]
            case ast.Subscript(value=table, slice=key) if speaks_of_a_quantity(key):
                sides = [table, key]
            case _:
                continue
        parts = [n for side in sides for n in ast.walk(side)]
        by_name = any(map(says_a_name, sides)) and any(map(speaks_of_a_quantity, sides))
        if by_name or any(is_a_constant(part, foreign) for part in parts):
            yield node.lineno


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE)
        if inside.parts[0] not in OTHERS:
            yield inside.as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def test_no_code_asks_which_quantity_it_is():
    assert [f"{name}:{line}" for name, tree in modules() for line in asks_which(tree)] == []


def test_only_who_makes_sensors_names_a_quantity():
    """A name of its own elsewhere (a kind of waiting, a parameter) is not imported from here."""
    importers = {
        name
        for name, tree in modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        and (node.module or "").startswith("mopro.instruments")
        and CONSTANTS & {alias.name for alias in node.names}
    }
    assert importers == MAKERS


@pytest.mark.parametrize(
    "code",
    [
        "if sensor.quantity == POSITION: pass",
        "x = [s for s in sensors if TEMPERATURE != s.quantity]",
        "y = quantity in (POSITION, TEMPERATURE)",
        "y = FORCE in quantities",
        "z = quantity.name == 'force'",
        "z = sensor.quantity is quantity.POSITION",
        "z = {POSITION: 1, FORCE: 2}[sensor.quantity]",
        "z = {'force': 2}[quantity.name]",
        "match sensor.quantity.name:\n    case 'force':\n        pass",
    ],
)
def test_a_question_is_found_in_whatever_form(code):
    assert list(asks_which(ast.parse(code)))


def test_a_constant_of_that_name_from_elsewhere_is_no_quantity():
    code = "if enters == FORCE: pass"
    assert list(asks_which(ast.parse(f"from mopro.instruments.quantity import FORCE\n{code}")))
    assert not list(asks_which(ast.parse(f"from mopro.formula.written import FORCE\n{code}")))
