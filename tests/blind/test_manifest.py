"""`mopro blind` removes and replaces only what it has made, and believes no path."""

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from helpers.paths import ROOT
from mopro.blind.cases.make import make
from mopro.blind.cases.manifest import MADE, Manifest
from mopro.blind.scoring.scored_cases import CaseFolder
from mopro.blind.scoring.verdict_source import VerdictSource
from mopro.cli.blind import command
from mopro.errors import DataError


def tree(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.*")}


def test_files_of_the_user_are_refused_before_anything_is_done(mopro, tmp_path):
    for name in ("mine.CMD", "notes.csv", "run1.CMD", "experiment.toml"):
        folder = tmp_path / name / "003"
        folder.mkdir(parents=True)
        (folder / name).write_text("precious")
        done = mopro("blind", "make", "--seed", 1, "--grid", "smoke", "--cases", 3,
                           "--out", tmp_path / name)  # fmt: skip
        assert done.returncode == 2
        assert f"003/{name}: not as `mopro blind` made it" in done.stderr
        assert tree(tmp_path / name) == {f"003/{name}": b"precious"}


def test_answers_of_other_origin_are_refused(tmp_path):
    (tmp_path / "answers.json").write_text("precious")
    with pytest.raises(DataError, match=r"answers.json: not as"):
        list(make(1, "smoke", tmp_path, frozenset(["003"])))
    assert tree(tmp_path) == {"answers.json": b"precious"}


@pytest.fixture
def ground(tmp_path):
    """A case with one run, made here."""
    Manifest(tmp_path, {}).replace("003", {"run1.CMD": b"WT1\n", "run2.CMD": b"WT2\n"})
    return tmp_path


def test_what_was_made_is_replaced_and_what_lies_beside_it_stays(ground):
    (ground / "003" / "notes.txt").write_text("mine")
    made = Manifest.read(ground)
    made.refuse_foreign(["003", "004"])
    made.replace("003", {"run1.CMD": b"WT3\n"})
    assert tree(ground).keys() == {MADE, "003/notes.txt", "003/run1.CMD"}
    assert (ground / "003" / "run1.CMD").read_bytes() == b"WT3\n"
    Manifest.read(ground).refuse_foreign(["003"])


def test_what_the_user_has_changed_since_is_refused(ground):
    (ground / "003" / "run2.CMD").write_text("changed")
    before = tree(ground)
    with pytest.raises(DataError, match=r"run2.CMD: not as"):
        Manifest.read(ground).replace("003", {"run1.CMD": b"WT3\n"})
    assert tree(ground) == before


def test_a_link_in_place_of_a_file_is_refused(ground, tmp_path_factory):
    precious = tmp_path_factory.mktemp("home") / "precious.CMD"
    precious.write_bytes(b"WT1\n")
    (ground / "003" / "run1.CMD").unlink()
    (ground / "003" / "run1.CMD").symlink_to(precious)
    with pytest.raises(DataError, match=r"run1.CMD: not as"):
        Manifest.read(ground).replace("003", {"run1.CMD": b"WT3\n"})
    assert precious.read_bytes() == b"WT1\n"


@pytest.mark.parametrize("count", range(5))
def test_a_disk_that_fails_at_any_rename_leaves_each_file_old_or_new(ground, monkeypatch, count):
    real, left = Path.replace, [count]

    def replace(self, target):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(5, "Input/output error")
        return real(self, target)

    old, new = tree(ground), {"run1.CMD": b"WT3\n", "run2.CMD": b"WT4\n"}
    made = Manifest.read(ground)
    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", replace)
        with contextlib.suppress(DataError):
            made.replace("003", new)
    for name, data in new.items():
        assert (ground / "003" / name).read_bytes() in (data, old[f"003/{name}"])
    Manifest.read(ground).replace("003", new)
    assert {name: (ground / "003" / name).read_bytes() for name in new} == new


@pytest.mark.parametrize("digest", [None, 5, ["0" * 64]])
def test_a_digest_that_is_no_text_is_not_believed(ground, digest):
    document = json.loads((ground / MADE).read_text())
    (files,) = document.values()
    files["003/run1.CMD"] = digest
    (ground / MADE).write_text(json.dumps(document))
    with pytest.raises(DataError, match="not the list that `mopro blind` writes"):
        Manifest.read(ground)


@pytest.mark.parametrize("moment", ["unlink", "replace"])
def test_a_kill_at_any_step_can_be_made_good(ground, moment):
    """Killed at the n-th rename or removal, the next make finds nothing foreign."""
    code = (
        "import os, signal, sys\nfrom pathlib import Path\n"
        "from mopro.blind.cases.manifest import Manifest\n"
        f"real, left = Path.{moment}, [int(sys.argv[2])]\n"
        "def counted(self, *a, **k):\n"
        "    left[0] -= 1\n"
        "    if left[0] < 0: os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return real(self, *a, **k)\n"
        f"Path.{moment} = counted\n"
        "runs = {f'run{i}.CMD': b'WT9' for i in range(3)}\n"
        "Manifest.read(Path(sys.argv[1])).replace('003', runs)\n"
    )
    for count in range(5):
        words = [sys.executable, "-c", code, str(ground), str(count)]
        subprocess.run(words, check=False, capture_output=True)
        Manifest.read(ground).refuse_foreign(["003"])
    Manifest.read(ground).replace("003", {"run1.CMD": b"WT1\n"})
    assert tree(ground).keys() == {MADE, "003/run1.CMD"}


@pytest.mark.parametrize(
    "path", ["../precious.CMD", "/precious.CMD", "003/../../p.CMD", "003/a/b.CMD", "003/.CMD", ".."]
)
def test_a_list_that_leads_elsewhere_is_not_believed(ground, path):
    document = json.loads((ground / MADE).read_text())
    (files,) = document.values()
    files[path] = "0" * 64
    (ground / MADE).write_text(json.dumps(document))
    with pytest.raises(DataError, match="not the list that `mopro blind` writes"):
        Manifest.read(ground)


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", "[" * 100_000, "\udcff"])
def test_a_list_of_other_origin_is_not_believed(ground, content):
    (ground / MADE).write_text(content, errors="surrogateescape")
    with pytest.raises(DataError, match="not the list that `mopro blind` writes"):
        Manifest.read(ground)


def test_a_machine_within_the_folder_to_be_filled_is_refused(mopro, tmp_path):
    text = (ROOT / "mopro" / "machine" / "machines" / "chow1992.toml").read_text()
    (tmp_path / "001").mkdir()
    (tmp_path / "001" / "machine.toml").write_text(text)
    options = ("--seed", 1, "--out", ".", "--machine", "001/machine.toml")
    done = mopro("blind", "make", *options)
    assert done.returncode == 2
    assert "--machine 001/machine.toml lies in the folder that --out would fill" in done.stderr
    assert (tmp_path / "001" / "machine.toml").read_text() == text


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    assert len(list(make(1, "smoke", folder, frozenset(["003"])))) == 2
    return folder


@pytest.fixture
def answers(made):
    """answers.json as data and a way to write it otherwise; put right again afterwards."""
    file = made / "answers.json"
    text = file.read_text()
    yield json.loads(text), lambda document: file.write_text(json.dumps(document))
    file.write_text(text)


def moved_case(document, number):
    document["cases"][number] = document["cases"].pop("003")


def moved_file(document, name):
    document["cases"]["003"]["files"][name] = "0" * 64


@pytest.mark.parametrize(
    ("change", "name"),
    [(moved_case, "../../003"), (moved_case, "/003"), (moved_case, ".."), (moved_case, ""),
     (moved_file, "../../x.CMD"), (moved_file, "/etc/x.toml"), (moved_file, "a/b.csv"),
     (moved_file, "x.sh")],
)  # fmt: skip
def test_answers_that_lead_out_of_the_folder_are_refused(made, answers, change, name):
    document, rewritten = answers
    change(document, name)
    rewritten(document)
    done = CliRunner().invoke(command, ["score", str(made)])
    assert isinstance(done.exception, DataError)
    assert done.exception.rule == "bad-answers"


@pytest.mark.parametrize("missing", ["files", "effects", "offsets", "instruments", "strange"])
def test_answers_that_lack_something_are_refused(made, answers, missing):
    document, rewritten = answers
    del document["cases"]["003"][missing]
    rewritten(document)
    with pytest.raises(DataError, match="not what `mopro blind make` writes"):
        CaseFolder.read(made)


@pytest.mark.parametrize(
    "content",
    [b'{"verdict": "nam', b"", b"\xff\xfe", b"[]", b"7", b'{"files": 1}', b"[" * 100_000,
     b'{"verdict": "named", "effects": 5, "files": {}, "seconds": 1.0}'],
)  # fmt: skip
def test_a_verdict_that_cannot_be_read_is_asked_again(made, monkeypatch, content):
    said = {"verdict": "none", "effects": [], "seconds": 1.0, "exit_code": 0, "stderr": ""}
    asked = []
    monkeypatch.setattr(
        "mopro.blind.scoring.verdict_source.VerdictSource._reconciled",
        lambda *a: asked.append(a) or dict(said),
    )
    kept = made / "003" / "verdict.json"
    kept.write_bytes(content)
    experiment = made / "003" / "experiment.toml"
    assert VerdictSource().ask("003", experiment)["verdict"] == "none"
    assert len(asked) == 1
    assert VerdictSource().ask("003", experiment)["verdict"] == "none"
    assert len(asked) == 1, "the new one is kept"
    kept.unlink()


def test_what_follows_an_answer_up_lies_among_nobody_else_s_files(made):
    copy = made / "followed" / "003"
    copy.mkdir(parents=True)
    (copy / "run1.CMD").write_text("precious")
    done = CliRunner().invoke(command, ["score", str(made)])
    assert isinstance(done.exception, DataError)
    assert "followed/003/run1.CMD: not as" in str(done.exception)
    assert (copy / "run1.CMD").read_text() == "precious"
    os.unlink(copy / "run1.CMD")
