"""Readings at the end of a range are told of an experiment that was written by hand."""

import numpy as np
import pytest

from helpers.stated import DRIVE, DRIVEN, driven, follows, write
from mopro.experiment.opened import open_experiment


def asked(notes):
    return [note for note in notes if "at the end of its range?" in note]


def slide(folder, low=-np.inf, high=np.inf, step=0.0):
    t = np.arange(0, 30, 0.05)
    told = np.interp(t % 10, [0, 1, 4, 5, 8, 9], [0, 0, 20, 20, 0, 0])
    read = told + 0.002 * np.random.default_rng(1).standard_normal(len(t))
    read = np.rint(read / step) * step if step else read
    columns = {"time_s": t, "target_mm": told, "position_mm": np.clip(read, low, high)}
    write(folder / "run.csv", columns)
    (folder / "e.toml").write_text(follows(0.002, "run.csv"), encoding="utf-8")
    return open_experiment(folder / "e.toml")


@pytest.mark.parametrize(
    ("low", "high", "which"), [(-np.inf, 18.0, "18 mm, the largest"), (1.0, np.inf, "1 mm, the sm")]
)
def test_an_end_of_a_slide_s_range_is_told_with_what_to_do(tmp_path, low, high, which):
    (note,) = asked(slide(tmp_path, low, high).notes)
    assert note.startswith("run.csv, scale: ")
    assert f"readings are exactly {which}" in note
    assert note.endswith("leave them out: empty their cells")


@pytest.mark.parametrize("step", [0.0, 0.001, 0.05])
def test_rests_at_the_ends_of_a_stroke_are_none(tmp_path, step):
    assert asked(slide(tmp_path, step=step).notes) == []


@pytest.mark.parametrize("share", [0.8, 1.0])
def test_the_end_of_a_range_of_an_axis_under_its_forces(tmp_path, share):
    columns = driven()
    read = columns["position_mm"]
    columns["position_mm"] = np.minimum(read, share * read.max())
    write(tmp_path / "run.csv", columns)
    (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
    (tmp_path / "e.toml").write_text(DRIVEN, encoding="utf-8")
    assert len(asked(open_experiment(tmp_path / "e.toml").notes)) == (share < 1)


@pytest.mark.parametrize("share", [0.8, 1.0])
def test_the_end_of_a_range_of_a_motor_s_sensor(lab, share):
    lab.two_runs()
    t, x = np.loadtxt(lab.path("fast.csv"), delimiter=",", skiprows=1, unpack=True)
    lab.csv("fast.csv", {"time_s": t, "position_1_in": np.minimum(x, share * x.max())})
    notes = asked(lab.load().notes)
    assert len(notes) == (share < 1)
    assert all(note.startswith("fast.csv, laser: ") for note in notes)
