"""No command runs code of the folder in which it is started, nor do the processes it starts."""

import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from helpers.commands import LIMIT_S, SETTINGS
from helpers.paths import ROOT

COMMAND = Path(sys.executable).parent / "mopro"
# All that a child could import: Python's library, what is installed, what Python looks for itself.
NAMES = sorted(
    {name for name in sys.stdlib_module_names if name not in sys.builtin_module_names}
    | {name for name in importlib.metadata.packages_distributions() if name.isidentifier()}
    | {"mopro", "sitecustomize", "usercustomize", "__main__"}
)
PACKAGES = ("mopro", "encodings", "numpy", "site")
TRAP = "import os\nopen(os.path.join({folder!r}, {name!r}), 'w').close()\n"


def plant(folder, traps, names=NAMES):
    """Files in `folder` named as modules, that make one of their name in `traps` if imported."""
    for name in names:
        text = TRAP.format(folder=str(traps), name=name)
        (folder / f"{name}.py").write_text(text)
        if name in PACKAGES:
            (folder / name).mkdir()
            (folder / name / "__init__.py").write_text(text)


def write_log(path):
    time_s = np.arange(4000) / 100.0
    with h5py.File(path, "w") as file:
        file["time_s"] = time_s
        file["position"] = 1.0 + np.random.default_rng(5).normal(0.0, 0.1, time_s.size)
        file["position"].attrs["unit"] = "mm"


@pytest.fixture
def folders(tmp_path):
    """A folder full of traps with a log, and where they tell that they were sprung."""
    folder, traps = tmp_path / "given", tmp_path / "traps"
    folder.mkdir()
    traps.mkdir()
    write_log(folder / "log.h5")
    plant(folder, traps)
    return folder, traps


def run(folder, command, **environment):
    return subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True,
        env=os.environ | SETTINGS | {"PYTHONPATH": str(ROOT)} | environment,
        timeout=LIMIT_S, check=False,
    )  # fmt: skip


def sprung(traps):
    return sorted(path.name for path in traps.iterdir())


CASE = "008"
MADE = ["blind", "make", "--seed", 1, "--grid", "smoke", "--cases", CASE, "--out", "cases"]


@pytest.mark.parametrize(
    "commands",
    [
        [["noise", "log.h5"]],
        [["import", "log.h5", "--as", "out", "--kind", "kinematic"]],
        [
            [*MADE, "--jobs", 2],
            ["blind", "score", "cases", "--jobs", 2],
            ["reconcile", f"cases/{CASE}/experiment.toml", "--jobs", 2],
        ],
        [["init", "start"], ["run", "start/move.CMD", "--emulate", "--plot", "run.svg"]],
    ],
    ids=lambda commands: commands[-1][0],
)
def test_a_command_and_its_processes_import_nothing_of_the_current_folder(folders, commands):
    """`python -m` put this folder first, and an h5py.py beside a log was run."""
    folder, traps = folders
    for words in commands:
        done = run(folder, [COMMAND, *words])
        assert done.returncode == 0, done.stdout + done.stderr
    assert sprung(traps) == []


# A process that has loaded all it needs, goes to the folder, and reads a log there.
READS = """
import os, sys
from pathlib import Path
import numpy as np
from mopro.logs.hdf5 import arrays_of
np.load, np.lib.format.read_array
os.chdir(sys.argv[1])
os.environ.update(zip(sys.argv[2::2], sys.argv[3::2]))
sys.path[:0] = ["", ".", "lib", os.getcwd()]
arrays, units = arrays_of(Path("log.h5"), lambda rows, columns: None)
os.write(1, " ".join(arrays).encode())
"""


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"PYTHONPATH": os.pathsep + "/nowhere"},
        {"PYTHONPATH": "/nowhere" + os.pathsep},
        {"PYTHONPATH": "."},
        {"PYTHONPATH": "lib"},
        {"PYTHONSTARTUP": "json.py"},
        {"PYTHONINSPECT": "1"},
        {"PYTHONWARNINGS": "error"},
        {"PYTHONHASHSEED": "7"},
        {"PYTHONSAFEPATH": ""},
    ],
    ids=str,
)
def test_a_child_finds_what_its_parent_found_and_nothing_here(folders, environment):
    folder, traps = folders
    (folder / "lib").mkdir()
    plant(folder / "lib", traps)
    settings = [word for pair in environment.items() for word in pair]
    done = run(folder.parent, [sys.executable, "-P", "-c", READS, folder, *settings])
    assert (done.stdout, done.returncode) == ("position time_s", 0), done.stderr
    assert sprung(traps) == []


# A module that only a copy of mopro has, and a process that starts it in its current folder.
TELLS = """
import json, sys
import mopro
print(mopro.__file__, json.__file__, sys.argv[1:])
sys.exit(7)
"""
STARTS = """
import sys
library = [number for number, entry in enumerate(sys.path) if entry.endswith("lib-dynload")]
sys.path.insert(library[0] + 1, sys.argv[1])
import mopro.process.jobs
done = mopro.process.jobs.run_module("mopro.tells", ["-x", "y z"], 60.0)
print(done.stdout.decode(), done.returncode)
"""


def test_a_child_runs_the_very_mopro_of_its_parent(tmp_path):
    """Also one that lies in the current folder, of which nothing else is imported."""
    home = tmp_path / "mopro"
    shutil.copytree(ROOT / "mopro", home, ignore=shutil.ignore_patterns("__pycache__"))
    (home / "tells.py").write_text(TELLS)
    plant(tmp_path, tmp_path, ["json", "runpy", "importlib", "sitecustomize"])
    done = run(tmp_path, [sys.executable, "-P", "-c", STARTS, tmp_path], PYTHONPATH="")
    expected = f"{home / '__init__.py'} {json.__file__} ['-x', 'y z']\n 7\n"
    assert done.stdout == expected, done.stderr
    assert not (tmp_path / "json").exists()


# Begun as a script, so that its options ask for nothing, with all loaded that it needs.
POOLS = """
import multiprocessing, os, sys
import mopro.process.jobs, multiprocessing.forkserver, multiprocessing.popen_spawn_posix
import multiprocessing.popen_fork, multiprocessing.popen_forkserver, multiprocessing.queues
import multiprocessing.synchronize, multiprocessing.connection, concurrent.futures.process

if __name__ == "__main__":
    folder, method, *path = sys.argv[1:]
    os.chdir(folder)
    os.environ.update(PYTHONPATH=path[0] if path else os.environ["PYTHONPATH"])
    before = dict(os.environ)
    multiprocessing.set_start_method(method)
    print(list(mopro.process.jobs.in_processes(abs, [-1, 2, -3], 2)), os.environ == before)
"""


@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
@pytest.mark.parametrize("entry", [[], [os.pathsep + "/nowhere"]])
def test_processes_of_a_pool_import_nothing_of_the_current_folder(folders, method, entry):
    """As they start on other systems too: `python -c` puts this folder first."""
    folder, traps = folders
    script = folder.parent / "pools.py"
    script.write_text(POOLS)
    done = run(folder.parent, [sys.executable, script, folder, method, *entry])
    assert (done.stdout, done.returncode) == ("[1, 2, 3] True\n", 0), done.stderr
    assert sprung(traps) == []


TEX = (
    "text.usetex: True\nfont.size: 30\nsavefig.dpi: 20\ntext.latex.preamble: \\input{/etc/passwd}\n"
)
SETTINGS_OF_LIBRARIES = {
    "TeX": ("matplotlibrc", TEX.encode()),
    "backend": ("matplotlibrc", b"backend: module://json_of_here\nsvg.fonttype: none\n"),
    "no text": ("matplotlibrc", b"\xff\xfe\x00"),
    "nonsense": ("matplotlibrc", b"\x1b[2Jlines: \x1b[31m\nfont.size: huge\n"),
    "a pipe": ("matplotlibrc", None),
    "numba": (".numba_config.yaml", b"disable_jit: 1\ndump_ir: 1\n"),
    "no YAML": (".numba_config.yaml", b"{[\x1b"),
    "numba's pipe": (".numba_config.yaml", None),
}


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    return picture_of(tmp_path_factory.mktemp("empty"))


def picture_of(folder, **environment):
    (folder / "P.CMD").write_text("UU012500/1\nVEL1 15.0\nACC1 0.2\nMRI1 0.2\nWX1\n")
    done = run(folder, [COMMAND, "run", "P.CMD", "--emulate", "--plot", "p.png"], **environment)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return (folder / "p.png").read_bytes()


@pytest.mark.parametrize("kind", SETTINGS_OF_LIBRARIES)
def test_settings_of_the_current_folder_change_no_picture(tmp_path, picture, kind):
    """`text.usetex` started LaTeX on a preamble of the folder's."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("latex", "xelatex", "pdflatex", "lualatex", "dvipng", "gs"):
        (programs / name).write_text(f"#!/bin/sh\ntouch {tmp_path}/started-{name}\n")
        (programs / name).chmod(0o755)
    name, content = SETTINGS_OF_LIBRARIES[kind]
    if content is None:
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).write_bytes(content)
    drawn = picture_of(tmp_path, PATH=f"{programs}{os.pathsep}{os.environ['PATH']}")
    assert list(tmp_path.glob("started-*")) == []
    assert drawn == picture
