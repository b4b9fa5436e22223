"""A run that is given twice counts once, and is told."""

import pytest

from helpers.stated import DRIVEN, drive_folder
from mopro.experiment.opened import open_experiment


@pytest.fixture
def twice(tmp_path):
    """A drive's run, and a copy of its data; the experiment has the first."""
    path = drive_folder(tmp_path, length_s=1.0)
    (tmp_path / "again.csv").write_bytes((tmp_path / "run.csv").read_bytes())
    return path


def add(path, keys):
    path.write_text(f"{DRIVEN}\n[[run]]\n{keys}\n", "utf-8")
    return open_experiment(path)


def test_a_copy_of_a_run_counts_once_and_is_told(twice):
    opened = add(twice, 'data = "again.csv"\nstart = { x = 0, v = 0 }')
    assert opened.system.runs == ("run.csv",)
    assert "again.csv: its readings are those of run.csv, which count once" in opened.notes[0]


def test_the_same_file_as_another_part_is_another_run(twice):
    opened = add(twice, 'data = "again.csv"\npart = [0, 0.5]\nstart = { x = 0, v = 0 }')
    assert opened.system.runs == ("run.csv", "again.csv")
    assert opened.notes == ()


def test_a_reading_that_differs_in_one_digit_is_another_run(twice):
    again = twice.parent / "again.csv"
    *rows, last = again.read_text("utf-8").splitlines()
    cells, reading = last.rsplit(",", 1)
    again.write_text("\n".join([*rows, f"{cells},{float(reading) + 1e-9!r}"]) + "\n", "utf-8")
    opened = add(twice, 'data = "again.csv"\nstart = { x = 0, v = 0 }')
    assert opened.system.runs == ("run.csv", "again.csv")


def test_a_motor_s_run_given_twice_counts_once(lab):
    lab.record("fast.CMD", "fast.csv")
    lab.write("again.csv", lab.path("fast.csv").read_text())
    lab.experiment([f'program = "fast.CMD"\ndata = "{name}"' for name in ("fast.csv", "again.csv")])
    experiment = lab.load()
    assert [trial.name for trial in experiment.trials] == ["fast.csv"]
    assert "again.csv" in experiment.notes[0]
