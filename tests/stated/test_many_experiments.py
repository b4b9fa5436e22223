"""Drawn experiments of every kind: bench/experiments.py in small."""

import pytest

from helpers.many_experiments.judge import KINDS, drawn
from mopro.experiment.opened import experiment_file


@pytest.mark.parametrize("seed", range(60))
def test_what_is_drawn_can_be_read(tmp_path, seed):
    kind, file = drawn((1, seed), tmp_path)
    assert kind in KINDS
    assert all(own.exists() for own in experiment_file(file).files)


def test_a_seed_makes_the_same_files(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    for folder in (one, other):
        folder.mkdir()
        drawn((1, 5), folder)
    for file in one.iterdir():
        assert file.read_bytes() == (other / file.name).read_bytes()
