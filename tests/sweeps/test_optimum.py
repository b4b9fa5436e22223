"""The search for the best point: as good as a fine grid, within bounds, the same for a seed."""

import pytest

import mopro
from helpers.sweeps import TEXT
from mopro.cli import optimize
from mopro.machine import load_machine
from mopro.sweeps import Sweep
from mopro.sweeps.designs import Design
from mopro.sweeps.executors import local
from mopro.sweeps.optimum import FIGURES, Bound, Goal, GoalError, optimum
from mopro.sweeps.targets import Variant
from mopro.sweeps.tasks import Subject
from mopro.sweeps.varied import all_varied

BASE = Variant(mopro.compile(TEXT), load_machine("chow1992"), 0.0)


def subject(**vary):
    return Subject(BASE, all_varied(vary.items(), BASE.program, BASE.machine))


def goal(figure, largest=False, *bounds):
    return Goal(FIGURES[figure][0], largest, tuple(map(Bound.read, bounds)))


def test_it_is_as_good_as_a_fine_grid():
    found = optimum(subject(ACC1="0.1:3"), goal("time", False, "margin>0.3"), 400)
    grid = Sweep.of(BASE, [("ACC1", "0.1:3:0.01")], Design()).run(local(1)).to_pylist()
    kept = [row for row in grid if row["outcome"] == "ok" and row["force_margin"] >= 0.3]
    best = min(row["time_s"] for row in kept)
    assert found.kept
    assert found.row["force_margin"] >= 0.3
    assert found.row["time_s"] <= best * 1.001
    assert found.runs <= 400


def test_the_largest_and_a_choice():
    found = optimum(subject(ACC1="0.5,1,2", payload="0,5lb"), goal("margin", True), 60)
    assert (found.row["ACC1_1000_in_s2"], found.row["payload_lb"]) == (0.5, 0)
    assert found.runs == 6


def test_the_same_seed_finds_the_same():
    runs = [optimum(subject(ACC1="0.1:3"), goal("time"), 60, seed=s) for s in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_bound_that_no_run_keeps_gives_the_nearest():
    found = optimum(subject(ACC1="1:3"), goal("time", False, "margin>0.9"), 60)
    assert not found.kept
    grid = Sweep.of(BASE, [("ACC1", "1:3:0.05")], Design()).run(local(1))
    assert found.row["force_margin"] > max(grid["force_margin"].to_pylist()) - 0.02
    assert not optimum(subject(ACC1="1:3"), goal("temperature"), 15).kept


@pytest.mark.parametrize(
    ("text", "column", "above", "value"),
    [
        ("margin>20%", "force_margin", True, 0.2),
        ("lag <= 50um", "largest_lag_m", False, 5e-5),
        ("temperature<80", "hour_temperature_C", False, 80),
    ],
)
def test_a_bound_is_read_with_its_unit(text, column, above, value):
    bound = Bound.read(text)
    assert (bound.column, bound.above) == (column, above)
    assert bound.value == pytest.approx(value)
    assert bound.missed_by(bound.value) == 0 < bound.missed_by(None)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("margin", "expected a figure and its bound, such as margin>0.2"),
        ("speed>1", "'speed' is no figure of a run: expected one of time, margin"),
        ("lag<5kg", "'kg' is not a unit of length"),
        ("time<soon", "is not a number with a unit"),
    ],
)
def test_what_is_no_bound_is_told(text, expected):
    with pytest.raises(GoalError, match=expected):
        Bound.read(text)


def test_the_command_offers_all_figures():
    assert tuple(FIGURES) == optimize._FIGURES
