"""`mopro noise` on files as an outsider has them."""

import json

import numpy as np
import pytest


def write_log(folder, values, rate_hz=100.0, heading="time_s,pos_mm"):
    rows = [f"{n / rate_hz:.4f},{v:.9g}" for n, v in enumerate(values)]
    (folder / "log.csv").write_text("\n".join([heading, *rows]) + "\n")
    return folder / "log.csv"


@pytest.fixture
def still(tmp_path):
    noise = 0.02 * np.random.default_rng(0).normal(size=2000)
    noise[700] += 1.0
    return write_log(tmp_path, noise)


def test_it_tells_the_level_and_the_line_to_write(mopro_process, still):
    done = mopro_process("noise", still.name)
    assert done.returncode == 0
    assert "noise_rms = 0.0" in done.stdout
    assert "none: white noise" in done.stdout
    assert "outliers   1: line 702; left out" in done.stdout


def test_json_has_the_interval_and_the_lines_of_the_file(mopro, still):
    (column,) = json.loads(mopro("noise", still.name, "--json").stdout)["columns"]
    low, high = column["noise_rms"]["ci95"]
    assert low < 0.02 < high
    assert column["outliers"] == [{"time_s": 7.0, "line": 702}]
    assert column["state"] == {"noise_rms": pytest.approx(column["noise_rms"]["value"], rel=1e-3)}


def test_a_stated_stretch_is_taken_for_standstill(mopro, tmp_path):
    rng = np.random.default_rng(1)
    write_log(tmp_path, np.linspace(0, 50, 2000) * (np.arange(2000) > 1000) + rng.normal(size=2000))
    done = mopro("noise", "log.csv", "--from", "0", "--to", "9.99", "--json")
    (column,) = json.loads(done.stdout)["columns"]
    assert column["readings"] == 1000
    assert column["noise_rms"]["value"] == pytest.approx(1.0, rel=0.1)


def test_without_a_standstill_it_exits_with_1(mopro, tmp_path):
    write_log(tmp_path, np.arange(2000.0))
    done = mopro("noise", "log.csv")
    assert done.returncode == 1
    assert "pos_mm: no noise told" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["log.csv", "--column", "speed"], "there is no column speed"),
        (["absent.csv"], "absent.csv: cannot be read: No such file"),
        (["log.csv", "--time", "pos_mm", "--rate", "5"], "exclude each other"),
    ],
)
def test_wrong_use_exits_with_2(mopro, tmp_path, arguments, said):
    write_log(tmp_path, np.zeros(10))
    done = mopro("noise", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
