"""Pipes in the folder of `mopro blind`: told at once, never waited for."""

import json
import os

import pytest

from mopro.blind.cases.manifest import MADE

ANSWER = {key: [] for key in ("effects", "offsets", "instruments")} | {
    "files": {"run1.CMD": "0"}, "group": "one", "sensor": "lvdt", "strange": None,
}  # fmt: skip


@pytest.mark.parametrize("name", ["answers.json", "001/run1.CMD", "001/more.csv", MADE])
def test_a_pipe_in_the_folder_of_cases_is_told(mopro, tmp_path, name):
    (tmp_path / "001").mkdir()
    (tmp_path / "answers.json").write_text(json.dumps({"seed": 1, "cases": {"001": ANSWER}}))
    (tmp_path / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / name)
    words = ("score", tmp_path) if name != MADE else (
        "make", "--seed", 1, "--grid", "smoke", "--cases", "001", "--out", tmp_path)  # fmt: skip
    done = mopro("blind", *words)
    assert done.returncode == 2
    assert "is a pipe" in done.stderr
