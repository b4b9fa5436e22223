"""Imports that import-linter cannot state: a room may use these modules and nothing else."""

import sys

import grimp
import pytest

# Room -> modules outside of the room and of the standard library that it may import.
ALLOWED = {
    "mopro.diagnosis": {"numpy", "scipy"},
    "mopro.benchmark.reference": {"numpy", "scipy", "numba"},
    "mopro.benchmark": {
        "numpy", "scipy", "numba", "mopro.errors", "mopro.files", "mopro.units", "mopro.machine",
    },
}  # fmt: skip


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
    return any(module == p or module.startswith(f"{p}.") for p in packages)


@pytest.mark.parametrize("room", ALLOWED)
def test_a_room_imports_only_what_it_may(graph, room):
    found = foreign_imports(graph, room)
    assert found, f"{room} imports nothing: is its name still right?"
    assert not {pair for pair in found if not within(pair[1], ALLOWED[room])}


def test_one_module_of_the_benchmark_reads_mopro_s_machine_model(graph):
    found = foreign_imports(graph, "mopro.benchmark")
    readers = {module for module, imported in found if within(imported, ["mopro.machine"])}
    assert readers == {"mopro.benchmark.machine"}


@pytest.mark.parametrize("imported", ["mopro", "mopro.emulator", "mopro.units"])
def test_any_import_of_mopro_in_the_reference_plant_is_found(graph, imported):
    plant = "mopro.benchmark.reference.plant"
    assert imported in graph.modules
    graph.add_import(importer=plant, imported=imported)
    assert (plant, imported) in foreign_imports(graph, "mopro.benchmark.reference")
    graph.remove_import(importer=plant, imported=imported)
