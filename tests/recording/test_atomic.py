"""Files that are there whole or not at all."""

import os

import pytest

from mopro.errors import DataError
from mopro.recording.atomic import written_beside


def test_what_is_written_replaces_what_was_there(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    with written_beside(path) as draft:
        draft.write_text("after")
        assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]
    assert path.read_text() == "after"
    umask = os.umask(0)
    os.umask(umask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask


def test_an_error_leaves_what_was_there(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    with pytest.raises(TypeError), written_beside(path) as draft:
        draft.write_bytes("no bytes")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.csv", "before")]


def test_a_signal_just_after_the_draft_was_made_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(os, "close", interrupted)
        with pytest.raises(KeyboardInterrupt), written_beside(tmp_path / "out.csv"):
            pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["missing/out.csv", "file/out.csv", "folder"])
def test_a_place_that_takes_no_file_is_named(tmp_path, name):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    with pytest.raises(DataError, match="cannot be written"), written_beside(tmp_path / name):
        pass
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]
