"""The search for the best point: as good as a fine grid, within bounds, the same for a seed."""

import statistics

import pytest

import mopro
from helpers.sweeps import FORCE_N, HARD, SIGMA_N, TEXT, least_force_N, uncertain_text
from mopro.cli import optimize
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.source import Source
from mopro.sweeps import Sweep
from mopro.sweeps.best_program import program_text
from mopro.sweeps.designs import Design
from mopro.sweeps.drawn import Draws, uncertain
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


@pytest.fixture(scope="module")
def careful():
    """The soonest move of a machine of uncertain force: subject, goal, draws and what is found."""
    base = Variant(
        mopro.compile(HARD, "P.CMD"), read_machine(Source("u.toml", uncertain_text())), 0.0
    )
    varied = all_varied([("ACC1", "0.5:2.5")], base.program, base.machine)
    asked = Subject(base, varied, uncertain=uncertain(base, varied))
    wanted, draws = Goal("time_s", False, (), risk=0.02), Draws(40, 1)
    return asked, wanted, draws, optimum(asked, wanted, 30, seed=1, draws=draws)


def test_the_best_for_drawn_machines_stalls_as_seldom_as_it_says(careful):
    asked, wanted, _, found = careful
    acc = found.values[0]
    chance = statistics.NormalDist(FORCE_N, SIGMA_N).cdf(least_force_N(asked.base, ACC1=[acc]))
    assert found.kept
    assert chance <= found.verified.at_most <= wanted.risk
    assert found.verified.missing.total >= 400
    careless = optimum(Subject(asked.base, asked.varied), wanted, 60, seed=1)
    assert careless.verified is None
    assert careless.row["time_s"] < found.row["time_s"]


def test_a_risk_that_no_point_meets_is_not_kept(careful):
    asked, wanted, draws, _ = careful
    varied = all_varied([("ACC1", "1.7,1.75")], asked.base.program, asked.base.machine)
    fast = Subject(asked.base, varied, uncertain=asked.uncertain)
    found = optimum(fast, wanted, 15, draws=draws)
    assert not found.kept


def test_the_program_of_the_best_runs_as_found_and_says_why(careful):
    asked, wanted, draws, found = careful
    text = program_text(asked, wanted, found, draws).decode()
    again = mopro.compile(text)
    acc = float(found.values[0])
    run = mopro.emulate(again, asked.base.machine).run
    assert run.duration_s == pytest.approx(found.row["time_s"])
    comments = [line for line in text.splitlines() if line.startswith(";")]
    told = "\n".join(comments)
    for said in (
        "least time_s", "machine: u, verdict not stated", f"ACC1 = {acc}", "40 machines, seed 1",
        "axis.pull_out_force", f"of {found.verified.missing.total} stall", "asked 2.000%",
    ):  # fmt: skip
        assert said in told
    kept = [line for line in HARD.splitlines() if "ACC1" not in line]
    assert [line for line in text.splitlines() if line in kept] == kept
    assert "; as fast as it goes" in text


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
