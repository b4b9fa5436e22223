"""The place of every key: in one pass, for whatever the standard parser accepts."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mopro.tomlfile.scan import MOST_LEVELS, BeyondLimit, places

TEXT = """\
name = "x"  # not = [a] key
axis.pitch = 1.5
"qu\\u006fted".'lit' = '''
not = 1
''' # here
[effects . drag]
b = { value = 1, "unit" = 'N]' }
  c = [[1, 2], [ {d = 1},
   { e = 2 } ]]
[[run]]
data = 1979-05-27 07:32:00
[run.sub]
f = -1.5e3
[[run]]
data = \"\"\"a "" \\\\\"\"\"\"\"
[effects]
last = 0x1F
"""


def text_at(text, span):
    return text.split("\n")[span.line - 1][span.column - 1 : span.end_column - 1]


def paths(data, path=()):
    """Every key, section and bracketed list element of a parsed file."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield (*path, key)
            yield from paths(value, (*path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            if isinstance(value, dict | list):
                yield (*path, index)
                yield from paths(value, (*path, index))


def test_each_kind_of_key_has_its_place():
    found = {path: (str(span), text_at(TEXT, span)) for path, span in places(TEXT).items()}
    assert set(found) == set(paths(tomllib.loads(TEXT)))
    assert found["axis", "pitch"] == ("2:6", "pitch")
    assert found["quoted", "lit"] == ("3:15", "'lit'")
    assert found["effects",] == ("16:2", "effects")
    assert found["effects", "drag"] == ("6:2", "effects . drag")
    assert found["effects", "drag", "b", "unit"] == ("7:18", '"unit"')
    assert found["effects", "drag", "c", 1, 1, "e"] == ("9:6", "e")
    assert found["run",] == ("10:3", "run")
    assert found["run", 0, "sub", "f"] == ("13:1", "f")
    assert found["run", 1, "data"] == ("15:1", "data")
    assert found["effects", "last"] == ("17:1", "last")


PIECES = [
    *("a", "b.c", '"a"', "'d e'", '"\\u0041"', " ", "=", " = ", "\n", "\n", "\r\n", ",", ".", "#x"),
    *("[", "]", "[[", "]]", "{", "}", "1", "-2.5e3", "true", "1979-05-27T07:32:00Z", "0b11"),
    *(
        '"s"',
        "'t'",
        '"""',
        "'''",
        '"',
        "'",
        "\\",
        '\\"',
        "[a]\n",
        "[[b.c]]\n",
        "[[e]]\n",
        "[e.f]\n",
    ),
    *("a = 1\n", "b.c = [1, {a = 2}]\n", "e = {a = 1}\n", "g = '''\n'''\n", 'h = """x"""""\n'),
]


@given(st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
def test_what_the_parser_accepts_has_a_place_for_every_key(text):
    found = places(text)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    assert set(found) == set(paths(data))
    # A carriage return is no part of a line; no key has one.
    keys = {path: text_at(text, span) for path, span in found.items()}
    assert all(str(path[-1])[-1:] in keys[path] for path in keys if isinstance(path[-1], str))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (".".join("a" * 20_000) + " = 1", f"1:{2 * MOST_LEVELS + 1}"),
        ("\n[" + ".".join("a" * 20_000) + "]", f"2:{2 * MOST_LEVELS + 2}"),
        ("a = " + "[" * 20_000, f"1:{5 + MOST_LEVELS}"),
        ("a = " + "{ a = " * 20_000, f"1:{6 * MOST_LEVELS + 1}"),
        ("a = [1, " + "9" * 5000 + "]", "1:9"),
        ("a = -9_223_372_036_854_775_809", "1:5"),
        ("a = 0x" + "f" * 5000, "1:5"),
    ],
)
def test_what_is_beyond_the_limits_is_refused_where_it_begins(text, place):
    with pytest.raises(BeyondLimit) as caught:
        places(text)
    assert str(caught.value.span) == place


def test_what_is_within_the_limits_is_not():
    keys = ".".join("a" * MOST_LEVELS)
    lists = "[" * MOST_LEVELS
    number = -(2**63)
    assert len(places(f"{keys} = {number}\nb = {lists}")) == 2 * MOST_LEVELS
