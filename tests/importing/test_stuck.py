"""Readings at the end of a range, or stuck, are told by import and repeated by compare."""

import json

import numpy as np
import pytest

TIMES = np.arange(1200) / 100.0
COMMAND = np.interp(TIMES % 6, [0, 1, 2.5, 3.5, 5, 6], [0, 0, 20, 20, 0, 0])


def readings(step, rms, lag=0, play=0.08):
    """The command through a play, late by `lag` rows, with noise, in steps of a converter."""
    placed = [0.0]
    for told in COMMAND[1:]:
        placed.append(min(max(placed[-1], told - play / 2), told + play / 2))
    late = np.concatenate((np.zeros(lag), np.array(placed)))[: len(TIMES)]
    seen = late + np.random.default_rng(0).normal(size=len(TIMES)) * rms
    return np.rint(seen / step) * step if step else seen


def checks(mopro, folder, *parts, heading="time_s,target_mm,pos_mm"):
    rows = [f"{a:.6f},{b:.6f},{c:.6f}\n" for part in parts for a, b, c in zip(*part, strict=True)]
    (folder / "log.csv").write_text(heading + "\n" + "".join(rows))
    done = mopro("import", "log.csv", "--as", "out", "--json")
    assert done.returncode == 0, done.stderr
    return [words for words in json.loads(done.stdout)["check"] if "exactly" in words]


@pytest.mark.parametrize("lag", [0, 5, 40])
@pytest.mark.parametrize(("step", "rms"), [(0, 0.003), (0.002, 0.003), (0.05, 0.003), (0, 0.0)])
@pytest.mark.parametrize("high", [18.0, 12.0])
def test_the_end_of_a_range_is_told(mopro, tmp_path, step, rms, lag, high):
    seen = np.minimum(readings(step, rms, lag), high)
    (words,) = checks(mopro, tmp_path, (TIMES, COMMAND, seen))
    count = np.count_nonzero(np.round(seen, 6) == high)
    assert f"{count} readings are exactly {high:g} mm, the largest of all" in words
    assert f"--missing {high:g} leaves them out" in words
    asked = words.removeprefix("column pos_mm: ").split(" (")[0]
    assert mopro("compare", "out/experiment.toml").stderr.count(asked) == 1


@pytest.mark.parametrize("lag", [0, 5, 40])
@pytest.mark.parametrize(
    ("step", "rms"), [(0, 0.003), (0.002, 0.003), (0.02, 0.003), (0.1, 0.02), (1.0, 0.0), (0, 0.0)]
)
@pytest.mark.parametrize("play", [0.0, 0.08, 1.0])
def test_a_rest_at_the_end_of_a_stroke_is_not(mopro, tmp_path, step, rms, lag, play):
    assert checks(mopro, tmp_path, (TIMES, COMMAND, readings(step, rms, lag, play))) == []


def test_each_recording_is_looked_at(mopro, tmp_path):
    seen = readings(0, 0.003)
    longer = (np.arange(1300) / 100, np.resize(COMMAND, 1300), np.resize(seen, 1300))
    (words,) = checks(mopro, tmp_path, longer, (TIMES, COMMAND, np.minimum(seen, 18.0)))
    assert words.startswith("column pos_mm of recording 2: 260 readings are exactly 18 mm")


@pytest.mark.parametrize("start", [300, 700, 1100])
def test_a_stuck_sensor_is_told(mopro, tmp_path, start):
    seen = readings(0, 0.003)
    seen[start : start + 80] = seen[start]
    (words,) = checks(mopro, tmp_path, (TIMES, COMMAND, seen))
    assert f"80 readings in a row are exactly {round(seen[start], 6):.10g} mm: is the" in words
    assert f"from {start / 100:g} to " in words


def test_noise_tells_the_end_of_a_range(mopro, tmp_path):
    checks(mopro, tmp_path, (TIMES, COMMAND, np.minimum(readings(0, 0.003), 18.0)))
    said = "260 readings are exactly 18 mm, the largest of all: at the end of its range?"
    assert f"CHECK: {said} (first in line 238)" in mopro("noise", "log.csv").stdout
    (_, told) = json.loads(mopro("noise", "log.csv", "--json").stdout)["columns"]
    assert [(e["value"], e["count"], e["line"]) for e in told["ends"]] == [(18.0, 260, 238)]
