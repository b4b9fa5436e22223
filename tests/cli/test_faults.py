"""Some trials of `bench/faults.py`: a call that fails tears no file and is not told as success."""

import pytest

from helpers.faults import FULL_DISK, workplace


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """The workplaces of three commands: one writes by a library that is not Python."""
    folder = tmp_path_factory.mktemp
    with (
        workplace("fmt", folder("fmt")) as fmt,
        workplace("run, parquet", folder("run")) as parquet,
        workplace("blind score", folder("score")) as score,
    ):
        yield {"fmt": fmt, "run, parquet": parquet, "blind score": score}


@pytest.mark.parametrize(
    ("command", "call", "number"),
    [
        ("fmt", "open to write", 3), ("fmt", "write", 1), ("fmt", "fsync", 1),
        ("fmt", "fsync", 2), ("fmt", "rename", 1), ("run, parquet", "rename", 1),
        ("run, parquet", FULL_DISK, 4), ("run, parquet", FULL_DISK, 7),
        ("blind score", "write", 1), ("blind score", "fsync", 1), ("blind score", "rename", 3),
    ],
)  # fmt: skip
def test_a_call_that_fails_loses_nothing_and_is_told(places, command, call, number):
    done = places[command].trial(call, number)
    assert not done.failures, done.said
    assert done.code == 2
    assert "cannot be written" in done.said


def test_a_score_meets_faults_in_the_experiment_that_follows_too(places):
    """The reply of every trial proposes one; rename 3 is of its files."""
    said = places["blind score"].trial("rename", 3).said
    assert "cases/followed/001/experiment.toml: cannot be written" in said


def test_there_are_no_more_calls_than_there_are(places):
    assert places["fmt"].trial("rename", 2) is None


def test_what_is_torn_is_a_failure(places):
    place = places["fmt"]
    place.trial("rename", 1)
    (place._folder / "P.CMD").write_text("half")
    assert set(place._failures("rename", 0, "")) == {"lost or torn", "exit 0, output missing"}
