"""Edits of a TOML text: what they take out or state, and all else as it was."""

import tomllib

import pytest

from mopro.source import Source
from mopro.tomlfile.edit import Text, quoted

OTHERS = """\
name = "m"  # of the shop
base.k = { value = 1.0, unit = "N/m" }  # stiff

[table]
several = [
  1,  # one

  2,
]
text = '''
[effects.a]
b = 7
'''
"""
SPELLED = {
    "a section": "[effects.a]\nb = 1\n",
    "of a quoted name": '[effects."a"]\nb = 1\n',
    "a value in several lines": "[effects.a]\nb = [\n 1,\n # no comment of another\n 2,\n]\n",
    "a section of its own": "[effects]\n[effects.a]\n[effects.a.b]\nvalue = 1\n",
    "a key in one line": "[effects]\na = { b = { value = 1 } }\n",
    "dotted": '[effects]\na.b.value = 1\na.b.unit = "N"\n',
}


def edited(text):
    return Text.of(Source("m.toml", text))


@pytest.mark.parametrize("spelled", SPELLED.values(), ids=SPELLED)
@pytest.mark.parametrize("after", ["", "[effects.c]\nb = 2\n"], ids=["last", "before another"])
def test_what_is_taken_out_is_gone_and_all_else_stays(spelled, after):
    """However it is spelled, and whatever looks like it inside of a string."""
    left = str(edited(OTHERS + spelled + after).without("effects", "a"))
    expected = tomllib.loads(OTHERS + after)
    assert tomllib.loads(left) == {"effects": {}} | expected or tomllib.loads(left) == expected
    assert left.startswith(OTHERS.rstrip("\n"))


@pytest.mark.parametrize(
    "spelled",
    [
        "base.k = 1",
        "[base]\nk = 1",
        '[base]\n"k" = [\n 1,\n 2 ]',
        "[base]\nk.value = 1\nk.unit = 2",
    ],
)
def test_a_value_is_stated_in_the_place_of_the_old_one(spelled):
    before, after = "# before\n", "\n# after\n[other]\nk = 3\n"
    text = edited(before + spelled + after).with_value(("base", "k"), "7  # fitted")
    assert tomllib.loads(str(text)) == {"base": {"k": 7}, "other": {"k": 3}}
    assert str(text).startswith(before)
    assert str(text).endswith(f"= 7  # fitted{after.rstrip()}")


def test_a_key_that_is_not_there_is_not_stated():
    text = edited("[base.k]\nvalue = 1\n")
    assert ("base", "k") not in text
    assert text.with_value(("base", "k"), "7") == text


def test_one_of_several_sections_of_a_list_is_taken_out():
    text = edited("".join(f'[[effect]]\nname = "{n}"\n# of {n}\n' for n in "abc"))
    assert [e["name"] for e in tomllib.loads(str(text.without("effect", 1)))["effect"]] == [
        "a",
        "c",
    ]
    assert "of b" not in str(text.without("effect", 1))


@pytest.mark.parametrize("text", ['"', "\\", "a\nb", "\x7f", "\ud800", "é"])
def test_a_quoted_text_is_one_of_toml(text):
    found = tomllib.loads(f"a = {quoted(text)}")["a"]
    assert found == text.replace("\x7f", " ").encode("utf-8", "replace").decode()
