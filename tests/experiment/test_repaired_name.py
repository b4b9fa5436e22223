"""The name of a repaired machine file is its own."""

import pytest

from mopro.experiment.sawyer.repaired import repaired_name


@pytest.mark.parametrize(
    ("name", "repaired"),
    [
        ("chow1992", "chow1992-repaired"),
        ("chow1992-repaired", "chow1992-repaired-2"),
        ("chow1992-repaired-9", "chow1992-repaired-10"),
        ("two\nlines", "two\nlines-repaired"),
    ],
)
def test_each_repair_has_another_name(name, repaired):
    assert repaired_name(name) == repaired
