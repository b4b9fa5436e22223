"""What an import does with the rows of a log: runs of recordings, and a ledger that is repeated."""

import json
import tomllib

import numpy as np
import pytest

from helpers.commands import run_here


def servo(rng, seconds=12.0, rate_hz=100.0):
    times = np.arange(0, seconds, 1 / rate_hz)
    told = 10 * (1 - np.cos(times)) * (times % 6 < 4)
    return times, told, told + 0.01 * rng.normal(size=len(times))


def text_of(*recordings):
    rows = [
        f"{t:.4f},{c:.4f},{'' if np.isnan(x) else f'{x:.4f}'}"
        for times, told, seen in recordings
        for t, c, x in zip(times, told, seen, strict=True)
    ]
    return "\n".join(["time_s,command_mm,position_mm", *rows]) + "\n"


def imported(folder, *more):
    done = run_here(folder, "import", "log.csv", "--as", "out", "--json", *more)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), tomllib.loads((folder / "out/experiment.toml").read_text())


@pytest.mark.parametrize("shift_s", [0.0, 0.0037])
def test_each_recording_is_a_run(tmp_path, shift_s):
    rng = np.random.default_rng(3)
    (times, told, seen), (_, _, other) = servo(rng), servo(rng)
    second = (times + shift_s, -told, -other)
    (tmp_path / "log.csv").write_text(text_of((times, told, seen), second))
    answer, experiment = imported(tmp_path)
    assert [run["data"] for run in experiment["run"]] == ["data.csv", "data_2.csv"]
    assert answer["rows"] == {"read": 2400, "used": 2400, "left_out": []}
    assert any("2 recordings" in words for words in answer["check"])
    data = np.genfromtxt(tmp_path / "out/data_2.csv", delimiter=",", names=True)
    assert data["time_s"] == pytest.approx(times + shift_s, abs=1e-6)
    assert data["command_mm"] == pytest.approx(-told, abs=1e-4)
    assert data["position_mm"] == pytest.approx(-other, abs=1e-4)
    compared = run_here(tmp_path, "compare", "out/experiment.toml", "--json")
    assert compared.returncode == 0, compared.stderr
    assert "CHECK: column time_s: 2 recordings" in compared.stderr
    assert json.loads(compared.stdout)["rows"] == answer["rows"]


def test_rows_without_a_reading_are_in_the_ledger_and_repeated(tmp_path):
    times, told, seen = servo(np.random.default_rng(3))
    seen[300:400:8] = np.nan
    (tmp_path / "log.csv").write_text(text_of((times, told, seen)))
    answer, experiment = imported(tmp_path)
    expected = {"read": 1200, "used": 1187, "left_out": [{"why": "no reading", "count": 13}]}
    assert answer["rows"] == experiment["rows"] == expected
    assert any(words.startswith("rows: 1200 read, 1187 used") for words in answer["check"])
    compared = run_here(tmp_path, "compare", "out/experiment.toml")
    assert "CHECK: rows of the log: 1200 read, 1187 used, 13 left out: 13 no rea" in compared.stderr


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("read = 3\nused = 2", "are not those that were read"),
        ("read = 3\nused = 3\nleft_out = 4", "expected left_out"),
        ("read = 3\nused = true", "expected whole numbers"),
        ("read = 3\nused = 3\nlost = 0", "lost"),
        ("read = 3\nused = 1\nleft_out = [{ why = 'no' }]", "expected whole numbers"),
    ],
)
def test_a_ledger_that_does_not_add_up_is_refused(tmp_path, rows, words):
    (tmp_path / "log.csv").write_text(text_of(servo(np.random.default_rng(0))))
    imported(tmp_path)
    path = tmp_path / "out/experiment.toml"
    head, _, rest = path.read_text().partition("[rows]\nread = 1200\nused = 1200\n")
    path.write_text(f"{head}[rows]\n{rows}\n{rest}")
    refused = run_here(tmp_path, "compare", "out/experiment.toml")
    assert refused.returncode == 2
    assert words in refused.stderr


def test_noise_tells_the_ledger(tmp_path):
    times, told, seen = servo(np.random.default_rng(3))
    seen[:] = 0.01 * np.random.default_rng(4).normal(size=len(seen))
    (tmp_path / "log.csv").write_text(text_of((times, told, seen)) + "12.00,")
    done = run_here(tmp_path, "noise", "log.csv")
    assert "rows: 1201 read, 1200 used, 1 left out: 1 cut off at the end" in done.stdout
    done = run_here(tmp_path, "noise", "log.csv", "--json")
    cut = {"why": "cut off at the end", "count": 1}
    assert json.loads(done.stdout)["rows"] == {"read": 1201, "used": 1200, "left_out": [cut]}
