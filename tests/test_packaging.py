"""The package as others get it: an installed wheel, an import without numpy, the README."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile

import pytest

from helpers.paths import ROOT


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, check=True, **options).stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation",
        "-w", folder, ROOT)  # fmt: skip
    return next(folder.glob("*.whl"))


def test_the_wheel_works_away_from_the_checkout(wheel, tmp_path):
    """Grammars come from the package there, from the repository's folder in a checkout."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    site = f"import sys; sys.path[:0] = [{str(tmp_path / 'site')!r}]\n"
    code = site + (
        "import mopro; from mopro.language.parse import grammar_path\n"
        "print(mopro.compile('HM1', grammar='extended').ops[0].axes, "
        "grammar_path('mopro.lark').parent.name, mopro.__file__)"
    )
    shown = run(sys.executable, "-I", "-c", code, cwd=tmp_path)
    axes, folder, place = shown.strip().rsplit(" ", 2)
    assert (axes, folder) == ("(1,)", "grammars")
    assert place.startswith(str(tmp_path))
    with zipfile.ZipFile(wheel) as archive:
        names = [n for n in archive.namelist() if n.startswith("mopro/programs/experiments/")]
    assert len(names) == 14
    path = "from mopro.thesis.tables import experiment_path; print(experiment_path(14).is_file())"
    assert run(sys.executable, "-I", "-c", site + path, cwd=tmp_path).strip() == "True"


@pytest.mark.parametrize("heavy", ["numpy", "numba", "pyarrow", "matplotlib", "rich", "serial"])
def test_compiling_loads_nothing_heavy(heavy):
    code = (
        f"import sys, mopro; mopro.compile('GO'); import mopro.cli.program_files; "
        f"print({heavy!r} in sys.modules)"
    )
    assert run(sys.executable, "-c", code).strip() == "False"


def test_an_emulated_run_loads_neither_compiler_nor_plotter_nor_link(tmp_path):
    code = (
        "import sys; from mopro.cli.main import group\n"
        f"group(['run', {str(ROOT / 'programs' / 'LVDT3.CMD')!r}, '--emulate'], "
        "standalone_mode=False)\n"
        "heavy = ('numba', 'matplotlib', 'pandas', 'scipy', 'serial')\n"
        "print([m for m in heavy if m in sys.modules])"
    )
    assert run(sys.executable, "-c", code, cwd=tmp_path).splitlines()[-1] == "[]"


def test_the_readme_begins_with_two_commands_and_ci_runs_the_second():
    text = (ROOT / "README.md").read_text()
    first, second = text.split("```")[1].splitlines()[1:], text.split("```")[3].splitlines()[1:]
    assert len(first) == len(second) == 1
    assert "mopro run programs/LVDT3.CMD --emulate" in first[0]
    assert "pytest" in second[0]
    shown = run("awk", "/^```/ { fences += 1; next } fences == 3", ROOT / "README.md")
    assert shown.splitlines() == second
    assert "fences == 3" in (ROOT / ".ci" / "run").read_text()


def test_the_readme_example_runs():
    code = (ROOT / "README.md").read_text().split("```python\n")[1].split("```")[0]
    profile, duration_s, position_m = run(sys.executable, "-c", code).split()
    assert (profile, duration_s) == ("trapezoid", "0.535")
    assert float(position_m) == pytest.approx(15 * 0.0254, abs=2e-4)


def test_the_console_script_is_installed():
    script = f"{sysconfig.get_path('scripts')}/mopro"
    assert run(script, "--version").startswith("mopro, version ")


def test_the_wheel_says_that_it_is_typed(wheel):
    with zipfile.ZipFile(wheel) as archive:
        assert "mopro/py.typed" in archive.namelist()


def test_the_wheel_has_the_viewer_and_the_licence_of_its_library(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {n.removeprefix("mopro/viewer/static/") for n in archive.namelist()}
    assert {"viewer.css", "app.js", "uplot/uPlot.iife.min.js", "uplot/LICENSE"} <= names


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdist")
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    return next(folder.glob("*.tar.gz"))


def test_the_wheel_is_the_same_wherever_and_whenever_it_is_built(wheel, sdist, tmp_path):
    """Of the source distribution, with other dates, modes and order of files."""
    with tarfile.open(sdist) as archive:
        # Python before 3.11.4 has no filters.
        archive.extraction_filter = getattr(tarfile, "data_filter", lambda member, _: member)
        archive.extractall(tmp_path)
    source = next(tmp_path.iterdir())
    for path in sorted(source.rglob("*"), reverse=True):
        os.utime(path, (1e9, 1e9))
        path.chmod(0o750 if path.is_dir() else 0o640)
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=source)
    assert next(tmp_path.glob("*.whl")).read_bytes() == wheel.read_bytes()


def test_the_wheel_has_its_licences(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {n.partition(".dist-info/")[2]: n for n in archive.namelist()}
        metadata = archive.read(names["METADATA"]).decode()
        licence = archive.read(names["licenses/LICENSE"]).decode()
    assert "License-Expression: MIT\n" in metadata
    assert "Copyright (c) 2026 the mopro authors" in licence
    assert {"licenses/THIRD_PARTY.md", "licenses/mopro/viewer/static/uplot/LICENSE"} <= names.keys()


def test_material_of_others_is_listed_where_its_licence_lies():
    """Each licence file of the repository but its own is a link in THIRD_PARTY.md."""
    tops = [ROOT / name for name in ("docs", "examples", "mopro", "programs", "tests")]
    found = [path for top in tops for path in top.rglob("*LICEN[CS]E*")]
    listed = [path.relative_to(ROOT).as_posix() for path in found]
    page = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    assert [path for path in listed if f"({path})" not in page] == []
    assert "mopro/viewer/static/uplot/LICENSE" in listed
    version = (ROOT / "mopro/viewer/static/uplot/VERSION").read_text("utf-8").split(",")[0]
    assert version in page


def test_the_source_distribution_has_what_a_build_needs_and_no_tests(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    tops = {name.partition("/")[0] for name in names}
    assert tops >= {"mopro", "grammars", "programs", "docs", "pyproject.toml", "README.md"}
    assert tops.isdisjoint({"tests", "bench", "editors", ".ci"})
    assert "grammars/mopro.lark" in names
    assert {"CHANGELOG.md", "CONTRIBUTING.md", "mopro/py.typed"} <= names
    assert {"LICENSE", "SECURITY.md", "THIRD_PARTY.md"} <= names


def test_the_oldest_versions_are_those_that_are_tried():
    """`.ci/run lowest` installs what .ci/lowest.txt pins."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["lsp"], *extras["pandas"]]
    wanted += [*extras["dask"], *extras["hdf5"], *extras["mcap"], *extras["web"]]
    bounds = dict(requirement.split(">=") for requirement in wanted)
    lines = (ROOT / ".ci" / "lowest.txt").read_text().splitlines()
    pins = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert pins.keys() == bounds.keys()
    for name, bound in bounds.items():
        assert f"{pins[name]}.".startswith(f"{bound}."), name


def test_what_ci_runs_with_the_oldest_versions_is_there():
    lines = (ROOT / ".ci" / "lowest-tests.txt").read_text().splitlines()
    files = [line for line in lines if not line.startswith("#")]
    assert files
    assert [file for file in files if not (ROOT / file).exists()] == []


def test_the_version_of_the_package_is_in_the_changes():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"\n## {project['version']}\n" in (ROOT / "CHANGELOG.md").read_text()
