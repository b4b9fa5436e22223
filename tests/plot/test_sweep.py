"""The picture of a sweep: a map with its border, or margins against times."""

import numpy as np
import pytest

import mopro
from mopro.machine import load_machine
from mopro.plot.sweep import plot_sweep
from mopro.sweeps import Sweep
from mopro.sweeps.designs import Design
from mopro.sweeps.executors import local
from mopro.sweeps.targets import Variant

TEXT = "UU012500/1\nVEL1 10.0\nACC1 0.5\nPARA1-\nMRI1 0.2\nWX1\n"


def drawn(vary, design=None, text=TEXT):
    base = Variant(mopro.compile(text, "P.CMD"), load_machine("chow1992"), 0.0)
    sweep = Sweep.of(base, vary.items(), design or Design())
    table = sweep.run(local(1))
    return table, plot_sweep(sweep, table, "P.CMD on m")


def test_a_grid_of_two_is_a_map_with_the_border_of_stalls():
    table, figure = drawn({"VEL1": "10,20,30", "ACC1": "0.5,1,2,3", "payload": "1kg"})
    panel, bar = figure.axes
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("VEL1 (in/s)", "ACC1 (1000 in/s2)")
    assert bar.get_ylabel() == "least force margin (%)"
    shown = panel.collections[0].get_array()
    assert shown.shape == (4, 3)
    margins = np.array(table["force_margin"]).reshape(3, 4).T
    ok = np.array(table["outcome"]).reshape(3, 4).T == "ok"
    assert 0 < ok.sum() < ok.size
    assert np.allclose(shown, np.where(ok, 100 * margins, 0.0))
    assert [text.get_text() for text in panel.get_legend().get_texts()] == [
        "border of stalls and trips"
    ]


def test_values_in_any_order_give_the_same_map():
    maps = []
    for velocities in ("10,20,30", "30,10,20", "30:10:-10"):
        panel = drawn({"VEL1": velocities, "ACC1": "1,0.5"})[1].axes[0]
        maps.append(panel.collections[0].get_array().tolist())
    assert maps[0] == maps[1] == maps[2]


def test_choices_are_named_on_an_axis():
    _, figure = drawn({"PARA1": "+,-", "VEL1": "10,20"})
    panel = figure.axes[0]
    assert [label.get_text() for label in panel.get_xticklabels()] == ["+", "-"]
    assert panel.get_legend() is None


@pytest.mark.parametrize(
    ("vary", "design"),
    [({"ACC1": "0.2:0.8:0.1"}, None), ({"VEL1": "5:30", "ACC1": "0.2:1"}, Design("sobol", 9))],
)
def test_other_designs_are_margins_against_times(vary, design):
    table, figure = drawn(vary, design)
    (panel,) = figure.axes
    lines = {line.get_label(): line.get_xydata() for line in panel.get_lines()}
    assert len(lines["a run"]) == table.num_rows
    best = lines["no other is both sooner and safer"]
    assert (np.diff(best, axis=0) > 0).all()
    for time_s, margin in lines["a run"]:
        assert ((best[:, 0] <= time_s) & (best[:, 1] >= margin)).any()


def test_refused_runs_leave_a_gap():
    text = TEXT.replace("MRI1", "MRI2")
    assert drawn({"VEL1": "10,20", "ACC1": "0.5,1"}, text=text)[1]._repr_png_()
    assert drawn({"VEL1": "10,20"}, text=text)[1]._repr_png_()
