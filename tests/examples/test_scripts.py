"""The scripts of examples/ on made-up data of the form that they are written for."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from helpers.commands import LIMIT_S, SETTINGS
from helpers.paths import ROOT

SCRIPTS = ("heater", "pendulum", "servo", "telescope")
RELAXED = (1747, 2347)
PLAY = 6.0


def run_script(name, *args):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["sh", str(ROOT / "examples" / f"{name}.sh"), *map(str, args)], capture_output=True,
        text=True, timeout=LIMIT_S, check=False, env=os.environ | SETTINGS | {"PATH": path},
    )  # fmt: skip


def write_servo(file, servo, play, seed):
    """A servo that holds while it is pulled left and right, 0.03 count for each of the pull."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(320)
    pulled = 150 * np.sin(2 * np.pi * t / 6.4)
    pull_a = np.round(RELAXED[0] + np.maximum(pulled, 0.0))
    pull_b = np.round(RELAXED[1] + np.minimum(pulled, 0.0))
    load = sum(RELAXED) - pull_a - pull_b
    pulled_at = np.maximum.accumulate(np.where(load != 0, np.arange(len(t)), 0))
    side = np.sign(load)[pulled_at]
    held = 2047 + 0.03 * load + play / 2 * side + 0.3 * rng.standard_normal(len(t))
    columns = {
        "time_s": t,
        f"{servo}_target_count": np.full(len(t), 2047),
        f"{servo}_position_count": np.round(held),
        "pullA_position_count": pull_a,
        "pullB_position_count": pull_b,
    }
    rows = np.column_stack(list(columns.values()))
    np.savetxt(file, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_is_short_and_asks_for_its_data(name, tmp_path):
    assert len((ROOT / "examples" / f"{name}.sh").read_text("utf-8").splitlines()) <= 60
    for folder in ((), (tmp_path,)):
        done = run_script(name, *folder)
        assert done.returncode == 2
        assert f"examples/{name}.sh FOLDER" in done.stderr


def test_the_servo_s_script_tells_play_from_a_preload(tmp_path):
    write_servo(tmp_path / "single_sts3215.csv", "dut", PLAY, 1)
    write_servo(tmp_path / "coupled_sts3215_no_offset.csv", "dut1", PLAY, 2)
    write_servo(tmp_path / "coupled_sts3215_home_offset.csv", "dut1", 0.0, 3)
    done = run_script("servo", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    single, unseen, pair, preloaded = done.stdout.split("\n$ mopro ")[1:]
    assert unseen.startswith("compare unseen.toml --apply repaired.toml")
    assert "Named: compliance, backlash_under_load." in pair
    assert "Named: compliance." in preloaded
    # Without the run that it is preloaded in, a friction under the load does nearly as well.
    assert "Ambiguous: compliance or friction_under_load, backlash_under_load." in single


def test_the_engine_s_example_finds_the_leak_of_a_simulator_of_its_own():
    path = ROOT / "examples" / "engine.py"
    imported = [line.split()[1] for line in path.read_text("utf-8").splitlines()
                if line.startswith(("import ", "from "))]  # fmt: skip
    assert imported == ["numpy", "mopro.engine"]
    done = subprocess.run(
        [sys.executable, path], check=True, capture_output=True, text=True, timeout=LIMIT_S
    )
    first, second, *_ = done.stdout.splitlines()
    assert first == "Verdict: named"
    low, high = (float(end) for end in second.partition("(")[2].rstrip(")").split(" to "))
    assert second.startswith("leak: q = ")
    assert low <= 0.02 <= high
