"""Sweeps over drawn machines: stalls as often as the normal distribution says, the same by name."""

import math
import statistics

import numpy as np
import pytest
from scipy import stats

import mopro
from helpers.sweeps import FORCE_N, HARD, SIGMA_N, counting, least_force_N, uncertain_text
from mopro.engine.verdict import Estimate
from mopro.errors import DataError
from mopro.experiment.wording import origin_words
from mopro.machine.file import read_machine
from mopro.source import Source
from mopro.sweeps import Sweep
from mopro.sweeps.designs import Design
from mopro.sweeps.drawn import VERIFIED, Draws, uncertain
from mopro.sweeps.executors import local
from mopro.sweeps.summary import Share
from mopro.sweeps.targets import Variant, VaryError
from mopro.sweeps.varied import all_varied


def machine(*interval, more=""):
    return read_machine(Source("uncertain.toml", uncertain_text(*interval) + more))


def variant(own=None):
    return Variant(mopro.compile(HARD, "P.CMD"), own or machine(), 0.0)


def swept(draws, vary, own=None, **more):
    return Sweep.of(variant(own), vary.items(), Design(), draws=draws).run(local(1), **more)


def test_stalls_are_as_frequent_as_the_normal_tail_below_the_force_that_suffices():
    acc = 1.7
    high = least_force_N(variant(), ACC1=[acc])
    expected = statistics.NormalDist(FORCE_N, SIGMA_N).cdf(high)
    assert 0.03 < expected < 0.97
    draws = 400
    (row,) = swept(Draws(draws, 3), {"ACC1": [acc]}).to_pylist()
    error = math.sqrt(expected * (1 - expected) / draws)
    assert abs(row["stall_probability"] - expected) < 3 * error
    assert row["stalled_draws"] == row["stall_probability"] * draws
    assert row["stall_probability"] < row["stall_at_most"] < row["stall_probability"] + 3 * error


def test_the_band_of_the_margin_is_that_of_the_force():
    """The margin grows with the force: its ends are those of the force."""
    vary = {"ACC1": [0.3]}
    draws = Draws(300, 1, band=0.8)
    (row,) = swept(draws, vary).to_pylist()
    assert (row["draws"], row["failed_draws"]) == (300, 0)
    base = variant()
    numbers = uncertain(base, all_varied(vary.items(), base.program, base.machine))
    forces = [float(own[0]) for own in draws.machines(numbers)]
    assert forces[0] == FORCE_N
    ends = np.quantile(forces[1:], [0.1, 0.9]).tolist()
    known = {**vary, "axis.pull_out_force": ends}
    at_ends = Sweep.of(base, known.items(), Design()).run(local(1))["force_margin"].to_pylist()
    assert at_ends[0] < at_ends[1]
    assert [row["force_margin_low"], row["force_margin_high"]] == pytest.approx(at_ends, abs=1e-3)
    assert row["time_s_low"] == row["time_s_high"] == row["time_s"]
    assert row["hour_temperature_C_low"] is None


def test_draws_have_the_stated_interval_and_stay_in_the_valid_range():
    base = variant(machine(0.0, 2 * FORCE_N))
    (number,) = uncertain(base, ())
    drawn = np.array(Draws(2000, 7).machines((number,))[1:], float).ravel()
    assert drawn.min() >= 1e-9
    wide = stats.norm(FORCE_N, 2 * FORCE_N / (2 * 1.959964))
    inside = drawn[(drawn > 30) & (drawn < 200)]
    share = wide.cdf(200) - wide.cdf(30)
    assert len(inside) / 2000 == pytest.approx(share, abs=3 * math.sqrt(share * (1 - share) / 2000))


def test_fresh_draws_are_others_and_the_same_seed_gives_the_same():
    numbers = uncertain(variant(), ())
    draws = Draws(5, 2)
    assert draws.machines(numbers) == draws.machines(numbers)
    assert draws.machines(numbers)[1:] != draws.machines(numbers, VERIFIED)[1:]
    assert draws.machines(numbers)[1:] != Draws(5, 3).machines(numbers)[1:]


def test_an_interrupted_sweep_goes_on_and_knows_its_results(tmp_path):
    out = tmp_path / "r.csv"
    sweep = Sweep.of(variant(), [("ACC1", "0.3,1.7")], Design(), draws=Draws(20, 1))
    points = []
    with pytest.raises(KeyboardInterrupt):
        sweep.run(counting(points, 9, lambda: (_ for _ in ()).throw(KeyboardInterrupt)), out=out)
    assert 0 < len(points) < 42
    table = sweep.run(counting(points), out=out)
    assert sorted(points) == list(range(42))
    assert table == swept(Draws(20, 1), {"ACC1": "0.3,1.7"})
    assert sweep.run(counting(points), out=out) == table
    assert len(points) == 42
    for others in (Draws(20, 2), Draws(20, 1, band=0.5), Draws(21, 1), None):
        other = Sweep.of(variant(), [("ACC1", "0.3,1.7")], Design(), draws=others)
        with pytest.raises(DataError, match="not the results of this sweep"):
            other.run(local(1), out=out)


def test_what_is_varied_is_not_drawn_and_what_belongs_to_other_runs_neither():
    with pytest.raises(DataError, match="no interval of a number"):
        swept(Draws(3), {"axis.pull_out_force": "90,100"})
    stated = 'b = { value = 4.0, unit = "N s/m", origin = "measured", place = "x, 95 %: 3 to 5" }\n'
    drag = f"[effects.viscous_drag]\n{stated}"
    names = [n.varied.name for n in uncertain(variant(machine(more=drag)), ())]
    assert names == ["axis.pull_out_force", "effects.viscous_drag.b"]
    of_runs = machine(more=f'{drag}runs = {{ "a.csv" = "00000000" }}\n')
    assert len(uncertain(variant(of_runs), ())) == 1


@pytest.mark.parametrize(
    ("low", "high"), [(3.5, 4.5), (0.0, 8.0), (2.00001e-5, 2.00009e-5), (-1.5e-7, 12.0)]
)
def test_intervals_are_read_as_a_repaired_file_has_them(low, high):
    words = origin_words(Estimate(4.0, "N s/m", (low, high), low == 0.0))
    stated = f'{{ value = 4.0, unit = "N s/m", origin = "measured", place = "e.toml, {words}" }}'
    drag = machine(more=f"[effects.viscous_drag]\nb = {stated}\n")
    number = uncertain(variant(drag), ())[1]
    assert number.sigma == pytest.approx((high - low) / 2 / stats.norm.ppf(0.975), rel=1e-3)


def test_an_end_that_the_data_do_not_bound_is_not_drawn():
    words = origin_words(Estimate(4.0, "N s/m", (3.0, math.inf), False))
    stated = f'{{ value = 4.0, unit = "N s/m", origin = "measured", place = "e.toml, {words}" }}'
    drag = machine(more=f"[effects.viscous_drag]\nb = {stated}\n")
    assert [n.varied.name for n in uncertain(variant(drag), ())] == ["axis.pull_out_force"]


@pytest.mark.parametrize(("wrong", "said"), [((0,), "at least 1"), ((9, 0, 1.5), "0 to 1")])
def test_no_draws_and_no_share_are_refused(wrong, said):
    with pytest.raises(VaryError, match=said):
        Draws(*wrong)


def test_the_bound_of_a_share_is_that_of_clopper_and_pearson():
    """The chance of so few is 5 % at the bound; without any it is the rule of three."""
    assert Share(0, 1000).at_most() == pytest.approx(3 / 1000, rel=5e-3)
    bound = Share(4, 100).at_most()
    assert stats.binom.cdf(4, 100, bound) == pytest.approx(0.05)
    assert Share(7, 7).at_most() == 1.0
