"""Imports that import-linter cannot state: what a room may use, and what the tests may."""

import ast
import pkgutil
import re
import sys
from collections import Counter

import grimp
import pytest

from helpers.paths import ROOT, TESTS

# Room -> modules outside of the room and of the standard library that it may import.
ALLOWED = {
    "mopro.engine": {"numpy", "scipy", "cachetools", "threadpoolctl", "numba"},
    "mopro.blind.reference": {"numpy", "scipy", "numba"},
    # mopro's own functions, and what all rooms share; verdicts are asked for by the command line.
    "mopro.blind": {
        "numpy", "scipy", "numba", "mopro", "mopro.engine.threads", "mopro.errors", "mopro.files",
        "mopro.formula", "mopro.inputs", "mopro.process.jit", "mopro.process.jobs",
    },
}  # fmt: skip
# The formulas of a user's file are hidden by mopro's own plant: the reference plant knows none.
EMULATED = "mopro.blind.cases.stated_effects"


@pytest.fixture(scope="module")
def graph():
    return grimp.build_graph("mopro", include_external_packages=True, cache_dir=None)


def foreign_imports(graph, room):
    """Pairs (module of the room, module that it imports) that leave the room."""
    own = {room, *graph.find_descendants(room)}
    return {
        (module, imported)
        for module in own
        for imported in graph.find_modules_directly_imported_by(module)
        if imported not in own and imported not in sys.stdlib_module_names
    }


def within(module, packages):
    """True if it is one of the packages or, unless that is mopro itself, in one."""
    return module in packages or any(module.startswith(f"{p}.") for p in packages - {"mopro"})


@pytest.mark.parametrize("room", ALLOWED)
def test_a_room_imports_only_what_it_may(graph, room):
    found = foreign_imports(graph, room)
    assert found, f"{room} imports nothing: is its name still right?"
    assert not {
        pair for pair in found if pair[0] != EMULATED and not within(pair[1], ALLOWED[room])
    }


def test_one_module_of_the_benchmark_reaches_behind_the_public_door(graph):
    """The one whose cases mopro's own plant makes; to allow another one is to say why."""
    assert any(
        within(imported, {"mopro.plant"}) and module == EMULATED
        for module, imported in foreign_imports(graph, "mopro.blind")
    )


@pytest.mark.parametrize("imported", ["mopro", "mopro.emulator", "mopro.units"])
def test_any_import_of_mopro_in_the_reference_plant_is_found(graph, imported):
    plant = "mopro.blind.reference.axis"
    assert imported in graph.modules
    graph.add_import(importer=plant, imported=imported)
    assert (plant, imported) in foreign_imports(graph, "mopro.blind.reference")
    graph.remove_import(importer=plant, imported=imported)


# -- the tests themselves -------------------------------------------------------

# Names of modules: those that `pythonpath` makes importable besides the helpers, and all tests.
OTHER_TESTS = {path.stem for path in TESTS.iterdir()} - {"helpers"}
OTHER_TESTS |= {path.stem for path in TESTS.rglob("test_*.py")}


def imports_of_tests(text):
    """Modules of tests/ other than the helpers that a test of this text would import."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            name = "." * node.level + (node.module or "")
            found |= {name} if node.level or name.split(".")[0] in OTHER_TESTS else set()
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            found |= {name for name in names if name.split(".")[0] in OTHER_TESTS}
    return found


def test_no_test_imports_another():
    texts = {path: path.read_text("utf-8") for path in TESTS.rglob("*.py")}
    assert len(texts) > 80
    assert {
        str(path): found for path, text in texts.items() if (found := imports_of_tests(text))
    } == {}


@pytest.mark.parametrize(
    "line",
    [
        "import test_files",
        "import cli.test_run",
        "from cli.test_run import SETUP",
        "from test_files import x",
        "from test_consistency import x",
        "from conftest import x",
        "from . import test_run",
        "from .test_run import SETUP",
    ],
)
def test_an_import_of_another_test_is_found(line):
    assert imports_of_tests(f"def test():\n    {line}\n")


def test_what_tests_share_stands_in_one_folder():
    others = [p for p in TESTS.rglob("*.py") if "helpers" not in p.parts]
    assert [p for p in others if not p.name.startswith("test_") and p.name != "conftest.py"] == []


PAGE = ROOT / "docs" / "architecture.md"
NAMED = sorted(set(re.findall(r"`(mopro(?:\.\w+)+)`", PAGE.read_text("utf-8"))))


def test_the_architecture_page_names_functions():
    assert len(NAMED) > 40


@pytest.mark.parametrize("name", NAMED)
def test_what_the_architecture_page_names_is_there(name):
    assert pkgutil.resolve_name(name) is not None


# -- names ------------------------------------------------------------------------

# Names of several modules that mean the same thing in each, by why that is so.
SAME_MEANING = {
    "a command, a page or a figure has the name of what it runs or shows": {
        "blind", "comparison", "conclusion", "glance", "limits", "link", "lint", "live", "logs",
        "run", "serve", "sweep",
    },
    "a rule has the name of what it judges": {"language", "motion", "text"},
    "one protocol, and those that keep it": {"backend", "system"},
    "the same step for a Sawyer motor and for a machine whose equations a file states": {
        "candidates", "entries", "file", "integrate", "model", "repaired", "simulation",
    },
    "machines whose equations a file states, and the experiments on them": {"stated"},
    "effects have the name of the part of the plant that they act on": {"heat", "measurement"},
    "the reference plant has the parts of the plant that it judges": {"axis", "heat", "plant"},
    "the search for them, and the passes that decide on its finds": {"alternatives"},
    "numba is asked for in one place of the engine, which stands alone, and of the kernel": {
        "compiled"
    },
}  # fmt: skip


def test_a_name_of_a_module_stands_once(graph):
    counts = Counter(module.rpartition(".")[2] for module in graph.modules if "mopro" in module)
    several = {name for name, count in counts.items() if count > 1}
    same = set().union(*SAME_MEANING.values())
    assert sorted(several - same) == [], "another thing has this name: call it by what it is"
    assert sorted(same - several) == [], "stands once by now: take it from the exceptions"
