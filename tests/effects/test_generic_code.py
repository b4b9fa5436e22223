"""Code outside of the effects' room names no effect: each is known by what it declares."""

import ast
import re
from pathlib import Path

import pytest

import mopro
from mopro.effects import catalogue

PACKAGE = Path(mopro.__file__).parent
# Rooms that are about single effects: their own, and the benchmark, which hides them.
ROOMS = ("effects", "blind")
FORBIDDEN = {*catalogue(), *(type(effect).__name__ for effect in catalogue().values())}
# A kind of fault that a virtual controller can have: pitches lost by a blow, at a given time.
# The effect of that name loses them in a given move. The name is one of the scenario files.
ALLOWED = {
    ("controller/faults.py", "lost_steps"),
    ("controller/device.py", "lost_steps"),
    # Hum in a log, whose noise is told; the effect of that name is in the emulated sensor.
    ("cli/logs.py", "hum"),
    ("noise/__init__.py", "hum"),
    ("noise/spectral.py", "hum"),
    # Examples for a person, in files that are to be edited.
    ("cli/machine_files.py", "viscous_drag"),
    ("cli/starting.py", "viscous_drag"),
    ("emulator/backend.py", "viscous_drag"),
    ("viewer/live.py", "lost_steps"),
}


def words(tree):
    """Each word of the module's strings (docstrings, too), names and attributes, with its line."""
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(text)):
                yield from ((word, node.lineno) for word in re.findall(r"\w+", text))
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
                yield name, node.lineno
            case ast.keyword(arg=str(name)):
                yield name, node.value.lineno
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name, node.lineno
            case ast.ImportFrom(module=str(module)):
                yield from ((part, node.lineno) for part in module.split("."))
                yield from ((alias.name, node.lineno) for alias in node.names)
            case ast.Import(names=names):
                parts = (part for alias in names for part in alias.name.split("."))
                yield from ((part, node.lineno) for part in parts)


def found_in(text):
    return {(word, line) for word, line in words(ast.parse(text)) if word in FORBIDDEN}


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE)
        if inside.parts[0] not in ROOMS:
            yield inside.as_posix(), path.read_text(encoding="utf-8")


def test_generic_code_contains_no_effect_s_name():
    said = [
        f"{name}:{line}: {word}"
        for name, text in modules()
        for word, line in sorted(found_in(text))
        if (name, word) not in ALLOWED
    ]
    assert said == []


def test_what_is_excepted_is_still_there():
    there = {(name, word) for name, text in modules() for word, _ in found_in(text)}
    assert there >= ALLOWED


@pytest.mark.parametrize(
    "code",
    [
        "mass = settings['payload_mass']",
        "def f():\n    '''As hum does.'''",
        "x = f'{a} of viscous_drag'",
        "from mopro.effects.measurement import Hum",
        "hum = 1",
        "f(backlash=1)",
        "a.VoltageSaturation",
    ],
)
def test_a_name_is_found_wherever_it_stands(code):
    assert found_in(code)
