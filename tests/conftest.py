"""Shared by all tests: the programs, and one profile for Hypothesis."""

import functools
import os
import signal
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

from helpers import commands
from helpers.paths import PROGRAMS

# Two workers on two cores: threads of linear algebra would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A warning fails a process that a test starts, and those that it starts, as it fails a test. Not
# those of names that libraries give up, nor of what a process that ends leaves open.
os.environ["PYTHONWARNINGS"] = "error,ignore::DeprecationWarning,ignore::ResourceWarning"

# A shell starts background jobs with these ignored, which processes inherit: tests that send
# them need what a terminal has.
for _number, _action in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
    (signal.SIGQUIT, signal.SIG_DFL),
):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _action)

# Seeded, so that a run can be repeated; noisy machines make deadlines meaningless.
settings.register_profile("mopro", derandomize=True, deadline=None)
settings.load_profile("mopro")


def pytest_configure(config):
    """Let the processes that tests start share bytecode, where none is written beside the source.

    Each of the some two hundred would compile the package anew.
    """
    if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
        folder = tempfile.TemporaryDirectory(prefix="bytecode-")
        os.environ["PYTHONPYCACHEPREFIX"] = folder.name
        config.add_cleanup(folder.cleanup)


@pytest.fixture(scope="session")
def program_files() -> list[Path]:
    return sorted(PROGRAMS.glob("*.CMD"))


@pytest.fixture(scope="session")
def programs_folder() -> Path:
    return PROGRAMS


@pytest.fixture
def mopro(tmp_path):
    """`mopro(*args, text=None)` runs the command line in the test's folder, in this process."""
    return functools.partial(commands.run_here, tmp_path)


@pytest.fixture
def mopro_process(tmp_path):
    """As `mopro`, as a process of its own: for what only a process can show."""
    return functools.partial(commands.run_process, tmp_path)
