"""`compare` judges a repaired machine by the measure of the verdict that repaired it."""

import json
import math

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import write

T = np.arange(0.0, 8.0, 0.01)
MACHINE = 'kind = "kinematic"\nname = "stage"\nunit = "mm"\n'
EXPERIMENT = """\
machine = "machine.toml"

[inputs]
command = {{ column = "target_mm" }}

[[sensor]]
name = "scale"
quantity = "position"
column = "place_mm"
noise_rms = {noise}

[[run]]
data = "run.csv"
"""


def experiment(folder, *, lag_s=0.0, stated=0.01, wild=0, wobble=0.0):
    """A stage that lags, read with noise of 0.01 mm and so many wild samples."""
    rng = np.random.default_rng(7)
    place = 20 * np.sin(1.3 * T) + 6 * np.sin(3.1 * T)
    lagging = place.copy()
    for i in range(1, len(T) if lag_s else 0):
        behind = lag_s * (place[i] - place[i - 1]) / 0.01
        decayed = (lagging[i - 1] - place[i - 1] + behind) * math.exp(-0.01 / lag_s)
        lagging[i] = place[i] - behind + decayed
    seen = lagging + wobble * np.sin(11 * T) + 0.01 * rng.standard_normal(len(T))
    seen[rng.choice(len(T), wild, replace=False)] += 3.0
    (folder / "machine.toml").write_text(MACHINE, encoding="utf-8")
    (folder / "experiment.toml").write_text(EXPERIMENT.format(noise=stated), encoding="utf-8")
    write(folder / "run.csv", {"time_s": T, "target_mm": place, "place_mm": seen})


def compared(folder, *options):
    done = run_here(folder, "compare", "experiment.toml", "--json", *options)
    return done.returncode, json.loads(done.stdout)


@pytest.mark.parametrize(("stated", "wild"), [(0.01, 0), (0.01, 4), (0.005, 0), (0.005, 4)])
def test_a_machine_with_nothing_hidden_agrees(tmp_path, stated, wild):
    experiment(tmp_path, stated=stated, wild=wild)
    code, answer = compared(tmp_path)
    assert (code, answer["verdict"]) == (0, "no disagreement")
    said = " ".join(answer["notes"])
    assert (f"has {wild} wild samples" in said) == bool(wild)
    assert ("as much as stated, and white" in said) == (stated < 0.01)
    assert answer["series"][0]["count"] == len(T) - wild
    assert answer["series"][0]["rms"] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("stated", [0.01, 0.005])
def test_a_small_structure_is_no_larger_noise(tmp_path, stated):
    experiment(tmp_path, stated=stated, wobble=0.01)
    code, answer = compared(tmp_path)
    assert (code, answer["verdict"]) == (1, "disagreement")
    assert not answer["notes"]


@pytest.mark.parametrize(("stated", "wild"), [(0.01, 4), (0.005, 4)])
def test_the_repaired_file_leaves_what_the_verdict_says(tmp_path, stated, wild):
    experiment(tmp_path, lag_s=0.04, stated=stated, wild=wild)
    done = run_here(
        tmp_path, "reconcile", "experiment.toml", "--json", "--jobs", "1", "--only", "lag",
        "--out", "repaired.toml",
    )  # fmt: skip
    told = json.loads(done.stdout)
    assert [effect["name"] for effect in told["effects"]] == ["lag"]
    (run,) = told["gap"]["runs"]
    code, answer = compared(tmp_path, "--apply", "repaired.toml")
    assert code == 0
    assert answer["applied"][0]["after_rms"] == pytest.approx(run["rerun_rms"], rel=1e-12)
    assert run["rerun_rms"] == pytest.approx(run["after_rms"], rel=1e-6)
    assert answer["applied"][0]["before_rms"] > 20 * run["rerun_rms"]
