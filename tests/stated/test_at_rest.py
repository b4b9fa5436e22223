"""An axis that hardly moves, or whose readings are equal for long: its speed is looked for."""

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import write
from mopro.experiment.opened import open_experiment

SWING = """\
kind = "axis"
name = "swing"
unit = "mm"
acceleration = "-w2 * x - b * v"

[base]
w2 = { value = 40, unit = "1/s2" }
b = { value = 0.5, unit = "1/s" }
"""
SEEN = """\
machine = "machine.toml"

[[sensor]]
name = "scale"
quantity = "position"
column = "place_mm"
noise_rms = "unknown"
adc_step = 0.5

[[run]]
data = "run.csv"
"""


@pytest.mark.parametrize("rows", [8, 9, 20, 60])
@pytest.mark.parametrize("moved", [[], [-1], [5], [-2, -1]])
@pytest.mark.parametrize("level", [0.0, 1e6])
def test_the_speed_at_the_start_has_a_range_where_most_readings_are_equal(
    tmp_path, rows, moved, level
):
    places = np.full(rows, level)
    places[moved] += 0.5
    write(tmp_path / "run.csv", {"time_s": np.arange(rows) * 0.02, "place_mm": places})
    (tmp_path / "machine.toml").write_text(SWING, "utf-8")
    (tmp_path / "experiment.toml").write_text(SEEN, "utf-8")
    found = open_experiment(tmp_path / "experiment.toml").system.base.parameters
    assert all(p.low < p.high for p in found), found


def test_an_axis_at_rest_gets_a_verdict(tmp_path):
    places = np.r_[np.zeros(19), 0.5]
    write(tmp_path / "run.csv", {"time_s": np.arange(20) * 0.02, "place_mm": places})
    (tmp_path / "machine.toml").write_text(SWING, "utf-8")
    (tmp_path / "experiment.toml").write_text(SEEN, "utf-8")
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--out", "repaired.toml")
    assert done.returncode in (0, 1), done.stderr
    assert (tmp_path / "repaired.toml").exists()
