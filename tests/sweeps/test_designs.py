"""Designs: which points are run."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import qmc

from mopro.sweeps.designs import Design
from mopro.sweeps.targets import PayloadTarget, VaryError
from mopro.sweeps.varied import Varied

LEVELS = Varied("payload", PayloadTarget(), "kg", (Fraction(1), Fraction(2), Fraction(3)))
DRAWN = Varied("payload", PayloadTarget(), "kg", (Fraction(0), Fraction(10)), drawn=True)


def test_a_grid_has_all_combinations_the_last_changing_first():
    points = Design().points([LEVELS, LEVELS])
    assert len(points) == len(set(points)) == 9
    assert points[:4] == [(1, 1), (1, 2), (1, 3), (2, 1)]


@pytest.mark.parametrize("kind", ["random", "sobol"])
def test_drawn_points_are_those_of_the_seed(kind):
    points = Design(kind, 50, seed=3).points([DRAWN, LEVELS])
    assert points == Design(kind, 50, seed=3).points([DRAWN, LEVELS])
    assert points != Design(kind, 50, seed=4).points([DRAWN, LEVELS])
    assert all(0 <= x <= 10 and level in LEVELS.levels for x, level in points)


def test_the_fewer_points_of_a_sobol_design_begin_the_more():
    more, fewer = (Design("sobol", count).points([DRAWN]) for count in (64, 40))
    assert more[:40] == fewer


def test_a_sobol_design_is_evener_than_a_random_one():
    spread = {}
    for kind in ("random", "sobol"):
        points = Design(kind, 256, seed=1).points([DRAWN, DRAWN])
        spread[kind] = qmc.discrepancy(np.array(points, dtype=float) / 10)
    assert spread["sobol"] < spread["random"] / 5


@pytest.mark.parametrize(
    ("design", "varied", "expected"),
    [
        (Design(), [DRAWN], "a grid needs a step"),
        (Design("grid", 5), [LEVELS], "goes with the designs random and sobol"),
        (Design("sobol"), [DRAWN], "needs a number of points"),
        (Design("sobol", 0), [DRAWN], "0 points: expected 1 to 200000"),
        (Design("random", 10**9), [DRAWN], "1000000000 points"),
        (Design(), [LEVELS] * 12, "531441 points: expected 1 to 200000"),
        (Design("latin", 5), [DRAWN], "there is no design latin: expected grid, random, sobol"),
    ],
)
def test_what_is_no_design_is_refused_before_the_work(design, varied, expected):
    with pytest.raises(VaryError, match=expected):
        design.points(varied)
