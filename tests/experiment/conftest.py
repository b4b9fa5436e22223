"""A laboratory for each test."""

import pytest

from helpers.laboratory import Lab


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path)
