"""Fixtures for tests of commands."""

import pytest


@pytest.fixture
def files(tmp_path):
    """The names in the folder that commands run in."""
    return lambda: sorted(path.name for path in tmp_path.iterdir())
