"""Dialect files: what they may say, and that a third one needs no code."""

from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mopro
from helpers.bench_of_link import SHORT, bench
from mopro.errors import ModelError
from mopro.link import builtin_dialects, load_dialect
from mopro.link.dialect import read_dialect
from mopro.link.flash import flash
from mopro.link.template import CHECKSUMS, BadFrame, Check, Template
from mopro.source import Source

FORM = Template("{number}:{body}*{check}")


def shipped(name):
    return (resources.files("mopro.link") / "dialects" / f"{name}.toml").read_text("utf-8")


def findings(text):
    with pytest.raises(ModelError) as caught:
        read_dialect(Source("mine.toml", text))
    return caught.value.diagnostics


def test_the_shipped_ones_say_that_they_are_assumed():
    assert builtin_dialects() == ["checked", "plain"]
    assert {load_dialect(name).origin for name in builtin_dialects()} == {"assumed"}


def test_a_third_dialect_needs_no_code(tmp_path):
    text = (
        shipped("checked")
        .replace('"crc16"', '"xor8"')
        .replace("{number}:{body}*", "#{number} {body} ")
    )
    text = text.replace('"DL {name}"', '"LOAD,{name}"').replace('"OK"', '"ACK"')
    text = text.replace('"{state} {statement} {completed}"', '"S={state}"')
    file = tmp_path / "mine.toml"
    file.write_text(text.replace('name = "checked"', 'name = "mine"'))
    joined = bench(load_dialect(str(file)))
    program = mopro.compile(SHORT)
    flash(joined.session, program, "MAIN")
    assert joined.stored == SHORT.splitlines()
    assert joined.run(program).run.trouble is None


@pytest.mark.parametrize(
    ("was", "becomes", "line_of", "rule", "says"),
    [
        ("baud = 9600", "baud = 3", "baud", "bad-value", "whole number from 50"),
        ("baud = 9600", "baut = 9600", "baut", "unknown-key", "baut"),
        ('"RN {name}"', '"RN"', "run =", "bad-template", "{name}"),
        ('"RN {name}"', '"RN {nane}"', "run =", "bad-template", "unknown field {nane}"),
        ('origin = "assumed"', 'origin = "rumour"', "origin", "missing-origin", "manual"),
        ('idle = "IDLE"', 'idle = "RUN"', "idle", "bad-value", "two states"),
        ('"crc16"', '"md5"', "checksum", "bad-value", "xor8, sum8, crc16"),
        ("[names]", "[nomes]", None, "missing-key", "[names]"),
        ("echo = false", "echo = 0", "echo", "bad-value", "true or false"),
        ("baud = 9600", "baud = ", "baud", "bad-toml", ""),
    ],
)
def test_a_finding_stands_at_its_line(was, becomes, line_of, rule, says):
    text = shipped("checked").replace(was, becomes, 1)
    found = [f for f in findings(text) if f.rule == rule and says in f.message]
    assert found
    if line_of:
        lines = [n for n, line in enumerate(text.splitlines(), 1) if line.startswith(line_of)]
        assert found[0].span.line in lines


def test_a_dialect_must_tell_when_a_line_is_done():
    text = shipped("checked").replace('acknowledge = "OK"', 'acknowledge = ""')
    assert any("nothing tells that a line is done" in f.message for f in findings(text))


@given(st.integers(0, 9999), st.text(st.characters(min_codepoint=32, max_codepoint=126)))
def test_a_frame_comes_back_as_it_went(number, body):
    check = Check(FORM, "crc16", 10000, "RS", "HELLO")
    assert check.unwrap(check.wrap(body, number)) == (number, body)


@given(
    st.sampled_from(sorted(CHECKSUMS)),
    st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=60),
    st.data(),
)
def test_a_flipped_bit_is_seen_by_every_checksum(kind, body, data):
    check = Check(FORM, kind, 10000, "RS", "HELLO")
    line = check.wrap(body, 1234)
    at = data.draw(st.integers(0, len(line) - 1))
    bit = data.draw(st.integers(0, 6))
    with pytest.raises(BadFrame):
        check.unwrap(line[:at] + chr(ord(line[at]) ^ (1 << bit)) + line[at + 1 :])


def test_numbers_are_compared_around_their_end():
    check = Check(FORM, "crc16", 10000, "RS", "HELLO")
    assert check.after(9999) == 0
    assert check.ahead(3, 9998) == 5
    assert check.ahead(9998, 3) == -5
