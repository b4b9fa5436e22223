"""A gap in the readings is a gap in each picture and page; the command goes on."""

import base64
import json
import re
import zlib

import numpy as np
import pytest

from helpers.commands import run_here
from mopro.engine.series import Series
from mopro.experiment.breaks import drawn
from mopro.experiment.opened import open_experiment
from mopro.plot.comparison import plot_comparison

TIMES = np.arange(0, 12, 0.02)
TOLD = 10 * np.sin(TIMES)
# Rows without a reading: in the midst, at the end, and one that was lost.
EMPTY = (((TIMES > 4) & (TIMES < 6)) | (TIMES > 11)) | (np.arange(len(TIMES)) == 100)
EXPERIMENT = """machine = "kinematic"
[inputs]
command = { column = "target_UNIT" }
[[sensor]]
name = "scale"
quantity = "position"
column = "pos_UNIT"
noise_rms = 0.01
[[run]]
data = "data.csv"
"""


def experiment(folder, unit="mm"):
    seen = TOLD + 0.01 * np.random.default_rng(0).normal(size=len(TIMES))
    rows = [
        f"{t:.6g},{c:.6g},{'' if e else f'{s:.6g}'}"
        for t, c, s, e in zip(TIMES, TOLD, seen, EMPTY, strict=True)
    ]
    (folder / "data.csv").write_text(
        f"time_s,target_{unit},pos_{unit}\n" + "\n".join(rows), "utf-8"
    )
    (folder / "experiment.toml").write_text(EXPERIMENT.replace("UNIT", unit), "utf-8")
    return folder / "experiment.toml"


def test_a_picture_has_a_break_where_cells_are_empty(tmp_path):
    comparison = open_experiment(experiment(tmp_path)).compare()
    figure = plot_comparison(comparison, "gap")
    lines = [
        line
        for axes in figure.get_axes()
        for line in axes.get_lines()
        if line.get_label() in ("measured", "simulated", "residual")
    ]
    assert len(lines) == 3
    for line in lines:
        times, values = line.get_data()
        inside = (times > 4) & (times < 6)
        assert inside.any()
        assert np.isnan(values[inside]).all()


def page_data(path):
    found = re.search(r'id="page-data">(.*?)</script>', path.read_text("utf-8"), re.DOTALL)
    page = json.loads(found[1])
    return page, zlib.decompress(base64.b64decode(page["block"]))


def array(block, reference):
    if "step" in reference:
        return reference["start"] + reference["step"] * np.arange(reference["count"])
    kind = {"f32": "<f4", "f64": "<f8"}[reference["type"]]
    return np.frombuffer(block, kind, reference["count"], reference["at"])


@pytest.mark.parametrize(("unit", "system"), [("mm", "SI"), ("um", "SI"), ("in", "inch")])
def test_a_page_has_the_break_the_whole_command_and_the_units_of_the_log(tmp_path, unit, system):
    experiment(tmp_path, unit)
    done = run_here(tmp_path, "compare", "experiment.toml", "--report", "page.html")
    assert done.returncode in (0, 1), done.stderr
    page, block = page_data(tmp_path / "page.html")
    assert page["units"] == system
    (track,) = page["views"][0]["tracks"].values()
    (part,) = track["parts"]
    times = array(block, part["start"])
    assert len(times) == len(TIMES) - 1, "of all rows only the one that was lost has none"
    channels = {name: array(block, ends["first"]) for name, ends in part["channels"].items()}
    inside = (times > 4) & (times < 6)
    assert np.isnan(channels["measured"][inside]).all()
    assert np.isnan(channels["simulated simulated"][inside]).all()
    size = {"mm": 1e-3, "um": 1e-6, "in": 0.0254}[unit]
    expected = size * np.interp(times, TIMES, TOLD)
    assert channels["command"] == pytest.approx(expected, rel=1e-4, abs=1e-4 * size)
    assert times[-1] == pytest.approx(TIMES[-1])


def test_readings_that_are_slow_or_irregular_have_no_gaps():
    rng = np.random.default_rng(0)
    for times in (np.arange(0, 100, 2.0), np.cumsum(rng.exponential(1.0, 200))):
        series = Series("run", "sensor", "mm", np.ones(len(times)), None, times)
        assert len(drawn(series).time_s) == len(times)
    assert len(drawn(Series("run", "table", "C", np.ones(5), None)).time_s) == 5
