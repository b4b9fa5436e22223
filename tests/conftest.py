"""Shared by all tests: the programs, and one profile for Hypothesis."""

import os
from pathlib import Path

import pytest
from hypothesis import settings
from paths import PROGRAMS

# Two workers on two cores: threads of linear algebra would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Seeded, so that a run can be repeated; noisy machines make deadlines meaningless.
settings.register_profile("mopro", derandomize=True, deadline=None)
settings.load_profile("mopro")


@pytest.fixture(scope="session")
def program_files() -> list[Path]:
    return sorted(PROGRAMS.glob("*.CMD"))


@pytest.fixture(scope="session")
def programs_folder() -> Path:
    return PROGRAMS
