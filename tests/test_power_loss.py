"""A loss of power while files are written: what may be on the disk then, old or new."""

import os

import pytest

from helpers.power_loss import Recorder, outcome, states
from mopro.files import make_folder, write


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """Records the changes of a folder under `os`, and says what a loss of power leaves."""
    (tmp_path / "out.csv").write_bytes(b"before")
    recorder = Recorder(tmp_path)
    for name, call in {"fsync": "fsync", "replace": "rename", "mkdir": "mkdir"}.items():
        real = getattr(os, name)

        def watched(path, *args, real=real, call=call, **options):
            recorder.meet(call, path)
            return real(path, *args, **options)

        monkeypatch.setattr(os, name, watched)

    def done():
        recorder.told()
        return recorder.start, recorder.changes

    return done


def test_an_output_is_old_or_new_and_stays(recorded, tmp_path):
    write(tmp_path / "out.csv", b"after")
    write(tmp_path / "new.csv", b"made")
    make_folder(tmp_path / "a" / "b")
    write(tmp_path / "a" / "b" / "deep.csv", b"deep")
    seen = outcome(*recorded())
    assert seen.states > 40
    assert (seen.torn, seen.lost) == ((), ())


@pytest.mark.parametrize(
    ("spared", "torn", "lost"),
    [
        ("file", ("out.csv",), ("out.csv",)),
        ("folder", (), ("out.csv",)),
    ],
)
def test_what_is_not_flushed_is_found(recorded, tmp_path, spared, torn, lost):
    draft = tmp_path / ".out.csv.mopro-1"
    with open(draft, "wb") as file:
        file.write(b"after")
        file.flush()
        if spared != "file":
            os.fsync(file.fileno())
    os.replace(draft, tmp_path / "out.csv")
    if spared != "folder":
        handle = os.open(tmp_path, os.O_RDONLY)
        os.fsync(handle)
        os.close(handle)
    seen = outcome(*recorded())
    assert (seen.torn, seen.lost) == (torn, lost)


def test_what_is_written_in_its_place_is_torn(recorded, tmp_path):
    (tmp_path / "out.csv").write_bytes(b"after")
    assert outcome(*recorded()).torn == ("out.csv",)


def test_all_that_a_disk_may_keep_is_looked_at(recorded, tmp_path):
    (tmp_path / "new.csv").write_bytes(b"made")
    start, changes = recorded()
    contents = [files.get("new.csv") for files in states(start, changes)]
    assert set(contents) == {None, b"", b"ma", b"made"}
