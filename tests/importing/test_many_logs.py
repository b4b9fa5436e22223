"""Logs of many kinds, mixed at random, imported and compared: bench/many_logs.py in small."""

import pytest

from helpers.many_logs.judge import REFUSED, RIGHT, judged
from helpers.many_logs.mixture import KINDS, drawn

# Of the kinds that were read wrongly once, and some of those that must be refused.
SEEDS = (5, 12, 15, 26, 36, 37, 43, 48, 67, 74, 78, 88)


@pytest.mark.parametrize("seed", SEEDS)
def test_it_is_read_right_or_refused_rightly(tmp_path, seed):
    found = judged(seed, tmp_path)
    assert found.outcome in (RIGHT, REFUSED), found


def test_the_same_seed_makes_the_same_log():
    assert drawn(11)[1:] == drawn(11)[1:]
    assert drawn(11)[2] != drawn(31)[2]


def test_mixtures_are_of_one_to_four_kinds_and_reach_every_kind():
    every = [drawn(seed)[1] for seed in range(150)]
    assert {len(kinds) for kinds in every} == {1, 2, 3, 4}
    assert len({kind for kinds in every for kind in kinds}) > 0.9 * len(KINDS)
