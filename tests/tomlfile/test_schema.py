"""Values and tables by schema: every finding, at its place, in printable words."""

from dataclasses import dataclass

import pytest

from mopro.errors import ModelError
from mopro.source import Source
from mopro.tomlfile import Document, read_source
from mopro.tomlfile.schema import (
    flag,
    number,
    one_of,
    quantity,
    record,
    section,
    stated,
    text,
    whole,
)


@dataclass(frozen=True)
class Part:
    length: float = stated(quantity("length", "mm"))
    count: int = stated(whole(1, 9), default=3)


@dataclass(frozen=True)
class Whole:
    name: str = stated(text(ascii_only=True))
    ratio: float = stated(number(0.0, 1.0))
    mode: str = stated(one_of("fast", "slow"))
    part: Part = section(record(Part))
    open: bool = stated(flag, default=False)


GOOD = 'name = "n"\nratio = 1\nmode = "fast"\n[part]\nlength = "2 in"\n'


def read(content):
    return Document(Source("f.toml", content)).read(record(Whole))


def findings(content):
    with pytest.raises(ModelError) as caught:
        read(content)
    return [(str(d.span), d.rule, d.message, d.hint) for d in caught.value.diagnostics]


def test_a_good_file_is_the_dataclass():
    assert read(GOOD) == Whole("n", 1.0, "fast", Part(pytest.approx(0.0508), 3), False)


@pytest.mark.parametrize(
    ("old", "new", "place", "rule", "says"),
    [
        ('"n"', "5", "1:1", "bad-value", 'expected name = "text"'),
        ('"n"', '"µ"', "1:1", "bad-value", "plain ASCII"),
        ("ratio = 1", "ratio = 1.5", "2:1", "bad-value", "a number from 0 to 1"),
        ("ratio = 1", "ratio = nan", "2:1", "bad-value", "a number from 0 to 1"),
        ("ratio = 1", "ratio = true", "2:1", "bad-value", "a number from 0 to 1"),
        ('"fast"', "[]", "3:1", "bad-value", "expected mode: one of fast, slow"),
        ("[part]", "open = 1\n[part]", "4:1", "bad-value", "true or false"),
        ('"2 in"', '"2 kg"', "5:1", "bad-value", "'kg' is not a unit of length"),
        ('"2 in"', '"-2 in"', "5:1", "bad-value", "must be at least 0"),
        ('"2 in"', '"' + "1" * 100_000 + '!"', "5:1", "bad-value", "such as 1.5mm"),
        ('"2 in"\n', '"2 in"\ncount = 10\n', "6:1", "bad-value", "a whole number from 1 to 9"),
        ("length", "lenght", "5:1", "unknown-key", "unknown key lenght"),
        ('length = "2 in"', "", "4:2", "missing-key", "[part] has no length"),
        ('name = "n"', "", "1:1", "missing-key", "the file has no name"),
        ("[part]\n", "part = 1\n#", "4:1", "missing-key", "expected a section [part]"),
        ("[part]\n", "#", "1:1", "missing-key", "expected a section [part]"),
    ],
)
def test_each_fault_stands_at_its_place(old, new, place, rule, says):
    assert old in GOOD
    found = findings(GOOD.replace(old, new, 1))
    assert any((place, rule) == f[:2] and says in f[2] for f in found), found


def test_all_faults_are_told_at_once_with_suggestions():
    found = findings('nmae = 1\nratio = 2\nmode = "x"\n[part]\nlength = "x"\ncount = 0\n')
    assert [f[:2] for f in found] == [
        ("1:1", "unknown-key"), ("1:1", "missing-key"), ("2:1", "bad-value"),
        ("3:1", "bad-value"), ("5:1", "bad-value"), ("6:1", "bad-value"),
    ]  # fmt: skip
    assert found[0][3] == "did you mean `name`?"


def test_keys_are_shown_short_and_printable():
    found = findings(GOOD + '"\\u001b[31m" = 1\n' + "x" * 9000 + " = 1\n")
    assert [f[2] for f in found] == ["unknown key \\x1b[31m", f"unknown key {'x' * 59}…"]


def test_a_file_with_a_byte_order_mark_or_other_line_ends_is_the_same_text(tmp_path):
    path = tmp_path / "f.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\r\nb = 2\r")
    assert read_source(path).text == "a = 1\nb = 2\n"


def test_other_text_than_utf_8_is_told_with_its_line(tmp_path):
    path = tmp_path / "f.toml"
    path.write_bytes(b"a = 1\nb = '\xff'\n")
    with pytest.raises(ModelError, match=r"it is not UTF-8 text \(line 2\) \[unreadable\]"):
        read_source(path)
