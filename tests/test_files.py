"""Output files as an outsider sees them: processes killed at the worst moment, links, pipes."""

import contextlib
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from helpers.commands import LIMIT_S
from mopro.errors import DataError
from mopro.files import claim, log, make_folder, output, write

SCRIPT = """
import os, signal, sys
from pathlib import Path
from mopro.files import output
with output(Path(sys.argv[1])) as draft:
    draft.write_text("after")
    {moment}
"""
DIE = "os.kill(os.getpid(), signal.SIGKILL)"
LIVE = "print('ready', flush=True); sys.stdin.read()"


def start(moment, path, **pipes):
    command = [sys.executable, "-c", SCRIPT.format(moment=moment), str(path)]
    return subprocess.Popen(command, text=True, **pipes)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_what_is_written_replaces_what_was_there(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    with output(path) as draft:
        draft.write_text("after")
        assert path.read_text() == "before"
        assert draft.parent == tmp_path
    assert names(tmp_path) == ["out.csv"]
    assert path.read_text() == "after"


def test_a_new_file_has_the_mode_that_the_user_wants_of_new_files(tmp_path):
    write(tmp_path / "new", b"")
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o666 & ~umask()


def test_an_error_leaves_what_was_there(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    with pytest.raises(TypeError), output(path) as draft:
        draft.write_bytes("no bytes")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.csv", "before")]


def test_a_signal_just_after_the_draft_was_made_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(os, "fstat", interrupted)
        with pytest.raises(KeyboardInterrupt), output(tmp_path / "out.csv"):
            pass
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["missing/out.csv", "file/out.csv", "folder", "loop", "n" * 300])
@pytest.mark.parametrize(
    "attempt",
    [
        lambda path: write(path, b""),
        lambda path: contextlib.ExitStack().enter_context(claim(path)),
        lambda path: contextlib.ExitStack().enter_context(log(path)),
    ],
)
def test_a_place_that_takes_no_file_is_named(tmp_path, name, attempt):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(DataError, match=f"{name}: cannot be written: ") as error:
        attempt(tmp_path / name)
    assert error.value.rule == "unwritable-output"
    assert names(tmp_path) == ["file", "folder", "loop"]


def test_a_kill_before_the_rename_leaves_the_old_file_and_the_next_write_tidies_up(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    assert start(DIE, path).wait(30) == -signal.SIGKILL
    assert path.read_text() == "before"
    assert len(names(tmp_path)) == 2
    write(tmp_path / "other.csv", b"")
    assert names(tmp_path) == ["other.csv", "out.csv"]


def test_the_draft_of_a_living_process_stays(tmp_path):
    path = tmp_path / "out.csv"
    with start(LIVE, path, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == "ready\n"
        write(tmp_path / "other.csv", b"")
        assert len(names(tmp_path)) == 2
        process.communicate("", timeout=LIMIT_S)
    assert process.returncode == 0
    assert (names(tmp_path), path.read_text()) == (["other.csv", "out.csv"], "after")


def test_nothing_that_only_looks_like_a_draft_is_removed(tmp_path):
    with output(tmp_path / "out.csv") as draft:
        real = draft.name
    token = real[-20:]
    others = [".out.csv", ".out.csv.mopro-", f".out.csv.mopro-{token[:12]}00000000",
              f"out.csv.mopro-{token}", f".out.csv.mopro-{token}.bak", f"{real}x"]  # fmt: skip
    for name in others:
        (tmp_path / name).write_text("mine")
    (tmp_path / real).mkdir()
    write(tmp_path / "out.csv", b"")
    assert names(tmp_path) == sorted([*others, real, "out.csv"])


def test_names_as_long_as_the_file_system_takes_them(tmp_path):
    for name in ("n" * 255, "µ" * 127):
        write(tmp_path / name, b"whole")
        assert (tmp_path / name).read_bytes() == b"whole"
    assert len(names(tmp_path)) == 2


def test_a_link_is_followed_and_stays(tmp_path):
    (tmp_path / "there").mkdir()
    target = tmp_path / "there" / "real.csv"
    target.write_text("before")
    (tmp_path / "one").symlink_to("there/two")
    (tmp_path / "there" / "two").symlink_to("real.csv")
    with output(tmp_path / "one") as draft:
        assert draft.parent == tmp_path / "there", "a rename stays within its file system"
        draft.write_text("after")
    assert target.read_text() == "after"
    assert (tmp_path / "one").is_symlink()
    assert (tmp_path / "there" / "two").is_symlink()


def test_a_link_to_nothing_yet_makes_its_target(tmp_path):
    (tmp_path / "link").symlink_to("real")
    write(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


def test_further_hard_links_are_kept_by_refusing(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("before")
    os.link(path, tmp_path / "second")
    with pytest.raises(DataError, match=r"2 names .hard links.*choose another name"):
        write(path, b"after")
    assert path.samefile(tmp_path / "second")
    assert path.read_text() == "before"


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755, 0o666])
def test_the_mode_stays_and_the_draft_has_it_from_the_first(tmp_path, mode):
    path = tmp_path / "out.csv"
    path.write_text("before")
    path.chmod(mode)
    with output(path) as draft:
        assert stat.S_IMODE(draft.stat().st_mode) == mode
        draft.write_text("after")
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert path.stat().st_mtime > 1e9


def test_the_owner_stays_where_the_system_permits(tmp_path, monkeypatch):
    path = tmp_path / "out.csv"
    path.write_text("before")
    asked = []

    def chown(draft, owner, group):
        asked.append((owner, group))
        if owner >= 0:
            raise PermissionError

    monkeypatch.setattr(os, "chown", chown)
    write(path, b"after")
    found = path.stat()
    assert asked == [(found.st_uid, found.st_gid), (-1, found.st_gid)]
    assert path.read_text() == "after"


@pytest.mark.parametrize("mode", [0o444, 0o400])
def test_a_read_only_file_is_refused_even_to_the_administrator(tmp_path, mode):
    path = tmp_path / "out.csv"
    path.write_text("before")
    path.chmod(mode)
    with pytest.raises(DataError, match="it is read-only; make it writable"):
        write(path, b"after")
    with pytest.raises(DataError, match="it is read-only; make it writable"), claim(path):
        pass
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("before", mode)


def test_a_pipe_gets_the_whole_and_stays_a_pipe(tmp_path):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    got = []
    reader = threading.Thread(target=lambda: got.append(path.read_bytes()))
    reader.start()
    write(path, b"x" * 100_000)
    reader.join(30)
    assert got == [b"x" * 100_000]
    assert path.is_fifo()
    assert names(tmp_path) == ["pipe.csv"]


def test_a_pipe_hears_nothing_of_what_failed(tmp_path):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    with pytest.raises(ZeroDivisionError), output(path) as draft:
        draft.write_text(str(1 / 0))
    assert path.is_fifo()


def test_a_full_device_is_told_and_stays_a_device(tmp_path):
    (tmp_path / "full").symlink_to("/dev/full")
    with pytest.raises(DataError, match="full: cannot be written: No space left on device"):
        write(tmp_path / "full", b"x" * 100_000)
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.parametrize("way", [">", ">>", "|"])
def test_standard_output_by_name_takes_its_place_among_what_is_printed(tmp_path, way):
    code = ("from pathlib import Path; from mopro.files import write; print('first', flush=True)\n"
            "write(Path('link'), b'second\\n'); print('third')")  # fmt: skip
    (tmp_path / "link").symlink_to("/dev/stdout")
    target = "cat" if way == "|" else "log"
    (tmp_path / "log").write_text("earlier\n")
    command = f'"$0" -c "$1" {way} {target}'
    shown = subprocess.run(
        ["sh", "-c", command, sys.executable, code], cwd=tmp_path, capture_output=True, check=True
    ).stdout
    if way != "|":
        shown = (tmp_path / "log").read_bytes().removeprefix(b"earlier\n" if way == ">>" else b"")
    assert shown == b"first\nsecond\nthird\n"


@pytest.fixture
def order(monkeypatch):
    """Calls of the system, in order: files and folders flushed, and renames."""
    done = []
    real_fsync, real_rename = os.fsync, Path.replace

    def fsync(handle):
        done.append(("flush", os.path.basename(os.readlink(f"/proc/self/fd/{handle}"))))
        real_fsync(handle)

    def rename(self, target):
        done.append(("rename", Path(target).name))
        return real_rename(self, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", rename)
    return done


def test_file_then_rename_then_folder_reach_the_disk(tmp_path, order):
    write(tmp_path / "out.csv", b"after")
    (flush, draft), *rest = order
    assert flush == "flush"
    assert draft.startswith(".out.csv.mopro-")
    assert rest == [("rename", "out.csv"), ("flush", tmp_path.name)]


def test_new_folders_reach_the_disk(tmp_path, order):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert order == [("flush", tmp_path.name), ("flush", "a")]


@pytest.mark.parametrize("inside", ["", "a", "a/b"])
def test_a_folder_in_whose_place_a_file_stands_is_told_by_the_name_asked_for(tmp_path, inside):
    (tmp_path / "file").write_text("")
    wanted = tmp_path / "file" / inside
    with pytest.raises(DataError, match="cannot be made") as told:
        make_folder(wanted)
    assert str(told.value).startswith(f"{wanted}: ")
    assert told.value.rule == "unwritable-output"


def test_a_disk_that_fails_to_flush_costs_the_new_file_not_the_old(tmp_path, monkeypatch):
    def fails(handle):
        raise OSError(5, "Input/output error")

    (tmp_path / "out.csv").write_text("before")
    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(DataError, match="Input/output error"):
        write(tmp_path / "out.csv", b"after")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.csv", "before")]


def test_an_error_about_another_file_names_it(tmp_path):
    with pytest.raises(DataError, match=r"out.csv: cannot be written: .*/none: No such file"), \
            output(tmp_path / "out.csv"):  # fmt: skip
        (tmp_path / "none").read_text()


def test_a_log_is_there_as_it_grows(tmp_path):
    path = tmp_path / "link.log"
    path.write_text("earlier")
    path.chmod(0o600)
    with log(path) as file:
        file.write("now")
        file.flush()
        assert path.read_text() == "now"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
