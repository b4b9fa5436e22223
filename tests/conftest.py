"""Shared by all tests: where the repository's files are, and one profile for Hypothesis."""

from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]

# Seeded, so that a run can be repeated; noisy machines make deadlines meaningless.
settings.register_profile("mopro", derandomize=True, deadline=None)
settings.load_profile("mopro")


@pytest.fixture(scope="session")
def program_files() -> list[Path]:
    return sorted((ROOT / "programs").glob("*.CMD"))


@pytest.fixture(scope="session")
def programs_folder() -> Path:
    return ROOT / "programs"
