"""`fmt` changes the layout and nothing else."""

import functools
import sys
from types import SimpleNamespace

import pytest
from hypothesis import given

import mopro
from mopro.cli.program_files import read_text
from mopro.errors import SourceError
from mopro.language import parse, source_from_bytes
from mopro.language.format import format_source
from mopro.source import Source
from mopro.testing import program_texts


def tidy(text):
    return format_source(Source("x.CMD", text), "extended").text


@given(program_texts("extended"))
def test_meaning_and_comments_stay_and_the_second_time_changes_nothing(text):
    once = tidy(text)
    assert mopro.compile(once, grammar="extended") == mopro.compile(text, grammar="extended")
    comments = [[c.text for c in parse(Source("x", t), "extended").comments] for t in (text, once)]
    assert comments[0] == comments[1]
    assert tidy(once) == once


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("  vel 1   40.", "VEL1 40.\n"),
        ("uu 0 12500 / 1;x ", "UU012500/1  ;x \n"),
        ("para 1 +\tgo", None),
        ("\tpara1 -\t; off", "PARA1-  ; off\n"),
        ("jump  b1\n: b1", "JUMP b1\n:b1\n"),
        ("wt 10\r\n\r\n\r\n\r\nwx 0\r\n\r\n", "WT10\r\n\r\nWX0\r\n"),
        ("  ; indented\ngo", "  ; indented\nGO\n"),
        ("velO 1.0\rmr2 -8\rmai 1 3", "VELO 1.0\rMR2 -8\rMAI1 3\r"),
        ("; nothing else", "; nothing else\n"),
        ("", ""),
    ],
)
def test_layout(before, after):
    if after is None:
        with pytest.raises(SourceError):
            tidy(before)
    else:
        assert tidy(before) == after


@pytest.fixture
def fmt(mopro):
    return functools.partial(mopro, "fmt", words=False)


def test_files_of_dos_keep_their_bytes(fmt, tmp_path):
    path = tmp_path / "old.CMD"
    path.write_bytes(b";\xc9\xcd\xbb\x0c \r\n vel1 1.0;\x80\r\n\x1ajunk\xff")
    assert fmt("--check", path).returncode == 1
    done = fmt("--diff", path)
    assert (done.returncode, b"+VEL1 1.0  ;" in done.stdout) == (1, True)
    assert fmt(path).returncode == 0
    assert path.read_bytes() == b";\xc9\xcd\xbb\x0c \r\nVEL1 1.0  ;\x80\r\n\x1ajunk\xff"
    assert fmt("--check", path).returncode == 0


def test_standard_input_to_standard_output(fmt):
    assert fmt("-", stdin=b"go\x1a").stdout == b"GO\n\x1a"


class Endless:
    """A standard input that never ends."""

    def read(self, size=-1):
        assert size >= 0, "it would take all memory"
        return b";" * size


def test_standard_input_is_bounded_as_a_file_is(monkeypatch):
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=Endless()))
    with pytest.raises(SourceError, match="larger than 16 MiB"):
        read_text("-")


def test_what_does_not_parse_is_left_and_told(fmt, tmp_path):
    bad, good = tmp_path / "bad.CMD", tmp_path / "good.CMD"
    bad.write_text("vel 1\n")
    good.write_text("go\n")
    done = fmt(bad, good)
    assert done.returncode == 2
    assert b"bad.CMD:1:1:" in done.stderr
    assert (bad.read_text(), good.read_text()) == ("vel 1\n", "GO\n")


def test_programs_of_the_repository_are_in_the_canonical_layout(program_files):
    for path in program_files:
        source = source_from_bytes(path.read_bytes(), path.name)
        assert format_source(source) == source
