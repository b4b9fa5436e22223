"""The user's cache: where the platform says and the user's alone, or nowhere."""

import os
import pickle
import subprocess
import sys

import pytest

from helpers.commands import LIMIT_S
from mopro.process import cachefolder
from mopro.process.cachefolder import cache_folder, read_kept, with_digest

COMPILE = "import mopro; print(mopro.compile('MRI1 1.0').ops[0])"


def compiled(cwd, code=COMPILE, drop=(), **changes):
    environment = {k: v for k, v in os.environ.items() if k not in drop} | changes
    return subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=environment,
        capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip


class Planted:
    """A pickle that shows by a file that it was read."""

    def __reduce__(self):
        return open, ("was-run", "w")


def test_the_folder_is_the_platform_s_and_the_user_s_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "new"))
    folder = cache_folder("kernels")
    assert folder == tmp_path / "new" / "mopro" / "kernels"
    assert {place.stat().st_mode & 0o777 for place in (folder, folder.parent)} == {0o700}


def test_a_relative_place_is_ignored(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    assert cache_folder() == tmp_path / "home" / ".cache" / "mopro"
    assert not (tmp_path / "here").exists()


def test_without_a_home_nothing_is_kept(tmp_path, monkeypatch):
    import pwd

    def unknown(uid):
        raise KeyError(uid)

    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HOME")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert cache_folder() is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("place", ["mopro", "mopro/kernels"])
def test_a_folder_that_others_may_write_to_is_not_used(tmp_path, monkeypatch, mode, place):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "mopro" / "kernels").mkdir(parents=True, mode=0o700)
    (tmp_path / "mopro").chmod(0o700)
    (tmp_path / place).chmod(mode)
    assert cache_folder("kernels") is None


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() is not None
    me = os.geteuid()
    monkeypatch.setattr(cachefolder.os, "geteuid", lambda: me + 1)
    assert cache_folder() is None


def test_a_place_that_is_no_folder_is_not_used(tmp_path, monkeypatch):
    (tmp_path / "mopro").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() is None


def test_what_is_kept_comes_back_or_not_at_all(tmp_path):
    path, data = tmp_path / "kept", bytes(range(256))
    path.write_bytes(with_digest(data))
    path.chmod(0o600)
    assert read_kept(path) == data
    whole = path.read_bytes()
    for bit in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        path.write_bytes(flipped)
        assert read_kept(path) is None
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert read_kept(path) is None
    path.write_bytes(whole)
    path.chmod(0o622)
    assert read_kept(path) is None
    assert read_kept(tmp_path / "none") is None


def test_no_pickle_of_the_current_folder_is_read(tmp_path):
    """Neither under the name that it has here, nor under `~`, which older versions used."""
    parsers = tmp_path / "cache"
    first = compiled(tmp_path, XDG_CACHE_HOME=str(parsers))
    names = [path.name for path in parsers.rglob("*.parser")]
    assert (first.returncode, len(names)) == (0, 1)
    for folder in (tmp_path / "rel" / "mopro", tmp_path / "~" / ".cache" / "mopro"):
        folder.mkdir(parents=True)
        folder.joinpath(names[0]).write_bytes(with_digest(pickle.dumps(Planted())))
    unknown = "import os, pwd; pwd.getpwuid = {}.__getitem__\n" + COMPILE
    homeless = compiled(tmp_path, unknown, drop=("HOME", "XDG_CACHE_HOME"))
    relative = compiled(tmp_path, XDG_CACHE_HOME="rel", HOME=str(tmp_path / "home"))
    for done in (homeless, relative):
        assert (done.returncode, done.stdout) == (0, first.stdout), done.stderr
    assert not (tmp_path / "was-run").exists()


def test_a_damaged_or_planted_parser_is_made_anew(tmp_path):
    first = compiled(tmp_path, XDG_CACHE_HOME=str(tmp_path))
    (kept,) = tmp_path.rglob("*.parser")
    whole = kept.read_bytes()
    for content in (pickle.dumps(Planted()), whole[:-1], b"", whole[:99] + b"\0" + whole[100:]):
        kept.write_bytes(content)
        again = compiled(tmp_path, XDG_CACHE_HOME=str(tmp_path))
        assert (again.returncode, again.stdout, again.stderr) == (0, first.stdout, "")
        assert kept.read_bytes() != content
        assert read_kept(kept) is not None
    assert not (tmp_path / "was-run").exists()


def test_processes_that_fill_the_cache_at_once_get_whole_parsers(tmp_path):
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", COMPILE]
    started = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(4)
    ]
    said = [process.communicate(timeout=LIMIT_S) for process in started]
    assert len(set(said)) == 1
    assert said[0][0].startswith(b"Move")
    assert said[0][1] == b""
    (kept,) = (path for path in tmp_path.rglob("*") if path.is_file())
    assert kept.suffix == ".parser"
    assert read_kept(kept) is not None


def test_a_full_cache_is_no_hindrance(tmp_path):
    code = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64))\n" + COMPILE
    done = compiled(tmp_path, code, XDG_CACHE_HOME=str(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")
    assert list((tmp_path / "mopro").iterdir()) == []
