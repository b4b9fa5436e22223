"""Statements, the oddities of DOS files, and every fault told at its place."""

import hashlib
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mopro
from helpers.paths import DATA
from mopro.errors import MoproError, Severity, SourceError
from mopro.language import ast, load, parse, source_from_bytes
from mopro.language.load import MOST_BYTES, MOST_LINES
from mopro.program import lower
from mopro.source import Source, Span
from mopro.testing import program_texts

BAD_PROGRAMS = sorted((DATA / "err").glob("*.CMD"))


def tree(data, grammar="attested"):
    data = data.encode() if isinstance(data, str) else data
    return parse(source_from_bytes(data, "X.CMD"), grammar)


def faults(data, grammar="attested"):
    with pytest.raises(SourceError) as caught:
        lower(tree(data, grammar))
    return caught.value.diagnostics


def only(data, grammar="attested"):
    (statement,) = tree(data, grammar).statements
    return statement


def test_each_attested_form():
    text = (
        "UU012500/1\nVEL1 40.0\nACC2 0.00008\nPARA1+\nPARA2-\nMRI1 -15.0\n"
        "MR2 8.0\nGO\nWX1\nWT2000\n:B1\nJUMP B1\n"
    )
    statements = tree(text).statements
    units, velocity, acceleration, on, off, move, target, go, wait, dwell, label, jump = statements
    assert (units.axis.number, units.numerator.value, units.denominator.value) == (0, 12500, 1)
    assert (velocity.axis.number, velocity.value.value) == (1, 40)
    assert acceleration.value.value == Fraction(8, 100_000)
    assert (on.switch.on, off.switch.on) == (True, False)
    assert (type(move), move.value.value) == (ast.Move, -15)
    assert (type(target), target.axis.number) == (ast.Target, 2)
    assert (type(go), go.span) == (ast.Go, Span(8, 1, 3))
    assert (type(wait), wait.axis.number) == (ast.WaitAxis, 1)
    assert dwell.milliseconds.value == 2000
    assert (label.name.text, jump.name.text) == ("B1", "B1")


def test_spans_count_from_one_and_end_behind():
    statement = only("\n\t MRI1   -15.0 ; there")
    assert statement.span == Span(2, 3, 15)
    assert statement.value.span(2) == Span(2, 10, 15)
    assert statement.axis.span(2) == Span(2, 6, 7)


@pytest.mark.parametrize(
    "data",
    [
        b"MRI1 2.5", b"mri1 2.5", b"\tMrI1\t2.5\r\n", b"\x0cMRI1 2.5\x0c\n\x0c", b"MRI1 2.50\r",
        b"\r\n\r\nMRI1 2.5\r\n\x1a", b"MRI1 2.5\x1ajunk \x00\xff", b"MRI1 2.5;\x81\xe6\x9b",
        b"\xef\xbb\xbfMRI1 2.5\n", "MRI1 2.5 ; 250 in/s²".encode(), b"MRI1 +2.5;", b"MRI 1 02.5",
    ],
)  # fmt: skip
def test_dos_oddities(data):
    statement = only(data)
    assert (statement.axis.number, statement.value.value) == (1, Fraction(5, 2))


def test_code_page_437_comments_keep_their_bytes():
    data = b";\xc9\xcd\xbb\r\nGO ;\x80\r\n"
    source = source_from_bytes(data, "X.CMD")
    assert source.encoding == "cp437"
    first, second = parse(source).comments
    assert first.text.encode("cp437") == b";\xc9\xcd\xbb"
    assert second.text.encode("cp437") == b";\x80"


def test_letter_o_means_all_axes_and_is_told():
    program = lower(tree("VELO 15.0\nacco 0.2\n"))
    assert [op.axes for op in program.ops] == [(1, 2), (1, 2)]
    assert [(w.rule, str(w.span)) for w in program.warnings] == [
        ("letter-o-axis", "1:4"),
        ("letter-o-axis", "2:4"),
    ]


def test_labels_are_the_same_in_either_letter_case():
    assert lower(tree(":b1\nJUMP B1\n")).labels == {"B1": 0}


@pytest.mark.parametrize("path", BAD_PROGRAMS, ids=lambda p: p.stem)
def test_bad_programs_state_their_faults_on_their_first_line(path):
    """`; expect 3:6 bad-number, 5:1 unknown-mnemonic`: all of them, and no other."""
    expected = path.read_text().splitlines()[0].removeprefix("; expect ").split(", ")
    with pytest.raises(SourceError) as caught:
        lower(parse(load(path)))
    assert [f"{d.span} {d.rule}" for d in caught.value.diagnostics] == expected


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("VELOCITY1 40", "did you mean `VEL`?"),
        ("MRR1 5", "did you mean `MR`?"),
        ("WIX1", "did you mean `WX`?"),
        ("JUMPB1", "did you mean `JUMP`?"),
        ("MC1 10.0", "--grammar extended"),
    ],
)
def test_near_misses_get_a_suggestion(line, hint):
    (fault,) = faults(line)
    assert fault.rule == "unknown-mnemonic"
    assert hint in fault.hint


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("WT 2.5s", "write `WT2500`"),
        ("WT 2.5", "write `WT2500`"),
        ("WT20 ms", "write `WT20`"),
        ("WT 3 sec ; rest", "write `WT3000`"),
        ("MRI 5", "for axis 1 write `MRI1 5`"),
        ("MRI -5", "for axis 1 write `MRI1 -5`"),
        ("VEL 4 ; slow", "for axis 1 write `VEL1 4`"),
        ("GOTO B1", "write `JUMP B1`"),
        ("goto", "write `JUMP` and a label"),
        ("# note", "a comment begins with `;`"),
        ("// note", "a comment begins with `;`"),
        ("REM note", "a comment begins with `;`"),
        ("`UU112500/1`", "write the statement without quotes"),
        ("REMOTE", "known are ACC, GO"),
        ("WT2000.5", "such a statement is written `WT2000`"),
    ],
)
def test_common_slips_are_told_how_to_write_it(line, hint):
    (fault,) = faults(line)
    assert hint in fault.hint


def test_a_near_label_is_suggested():
    (fault,) = faults(":LOOP1\nJUMP LOOP2\n")
    assert (fault.rule, fault.hint) == ("unknown-label", "did you mean `LOOP1`?")


def test_the_message_says_where_what_was_expected_and_how_to_write_it():
    rendered = faults("UU012500/1\n  MRI1 abc ; note\n")[0].render(
        source_from_bytes(b"UU012500/1\n  MRI1 abc ; note\n", "X.CMD")
    )
    assert rendered.splitlines() == [
        "X.CMD:2:8: expected a plain decimal number, found `abc` [bad-number]",
        "    MRI1 abc ; note",
        "         ^~~",
        "  such a statement is written `MRI1 15.0`",
    ]


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (b"", "empty-program"),
        (b"\r\n \r\n; only words\r\n", "empty-program"),
        (b"\x1aMRI1 2.5", "empty-program"),
        (b"\x7fELF\x00\x01\x02", "binary-file"),
        (b"GO" + b" " * 5000, "too-long"),
        (b"MRI1 " + b"9" * 40, "too-long"),
        (b"A" * (MOST_BYTES + 1), "too-long"),
        (b"WT1\n" * (MOST_LINES + 1), "too-long"),
        (b"\r" * (MOST_LINES + 1), "too-long"),
        (b"\n" * MOST_LINES, "empty-program"),
    ],
)
def test_files_that_are_no_programs(data, rule):
    assert [f.rule for f in faults(data)] == [rule]


def test_the_extended_grammar_adds_and_takes_nothing_away():
    assert only("MRI1 2.5", "extended") == only("MRI1 2.5")
    kinds = [type(s) for s in tree("MAI1 1\nMA1 1\nMC1 1\nSK1 -1\nST1\nHM1", "extended").statements]
    assert kinds == [
        ast.MoveAbsolute, ast.TargetAbsolute, ast.Continuous, ast.Seek, ast.Stop, ast.Home,
    ]  # fmt: skip


@given(program_texts())
def test_generated_programs_parse_to_their_statements(text):
    parsed = parse(source_from_bytes(text.encode("cp437"), "X.CMD"))
    for statement in parsed.statements:
        line = parsed.source.line(statement.span.line)
        word = line[statement.span.column - 1 : statement.span.end_column - 1]
        assert word == word.strip()
        assert word[0] == ":" or word[:2].upper() == statement.form[:2]


@given(st.binary(max_size=200) | program_texts().map(str.encode), st.data())
def test_no_bytes_bring_anything_but_findings_inside_the_file(data, draw):
    if data:
        at = draw.draw(st.integers(0, len(data)))
        data = data[:at] + draw.draw(st.binary(max_size=3)) + data[at + 1 :]
    try:
        lower(tree(data))
    except MoproError as error:
        source = error.source
        for finding in error.diagnostics:
            assert 1 <= finding.span.line <= max(1, len(source.lines))
            assert 1 <= finding.span.column <= len(source.line(finding.span.line)) + 1
            assert finding.render(source)


SETUP = b"UU012500/1\r\nVEL1 15.0\r\nACC1 0.5\r\n"


@pytest.mark.parametrize("before", [b"", b"WT1", b"WT1\n", b"WT1\r\n\r\n", b"WT1\r", b"WT1 ;\x81"])
@pytest.mark.parametrize("rest", [b"WT2\r\n", b"\r\n\x1a\r\nWT2", b"junk \x00\xff", b" ;"])
def test_what_stands_behind_a_ctrl_z_is_told_with_its_line(before, rest):
    data = SETUP + before + b"\x1a" + rest
    program = lower(parse(source_from_bytes(data, "X.CMD")))
    (found,) = program.warnings
    assert (found.rule, found.severity) == ("text-after-end", Severity.WARNING)
    source = source_from_bytes(SETUP + before, "X.CMD")
    lines = source.lines_with_ends
    last = lines[-1]
    place = (len(lines) + 1, 1) if last.endswith(("\r", "\n")) else (len(lines), len(last) + 1)
    assert (found.span.line, found.span.column) == place
    assert program.ops == lower(parse(source)).ops
    if b"\xff" not in rest and b"\x81" not in before:
        assert mopro.compile(data.decode()).warnings == program.warnings


@pytest.mark.parametrize(
    "rest", [b"", b"\x1a", b"\x1a" * 100, b"\r\n", b" \t\x1a\r\n\x1a\x0c", b"\0" * 128]
)
def test_what_fills_up_the_last_block_of_a_file_is_not_told(rest):
    program = lower(parse(source_from_bytes(SETUP + b"WT1\r\n\x1a" + rest, "X.CMD")))
    assert program.warnings == ()


def test_a_program_that_a_ctrl_z_leaves_empty_is_refused_with_its_place():
    (found,) = faults(b"; notes\r\n\x1aWT100\r\n")
    assert (found.rule, found.hint) == ("empty-program", "it ends at the Ctrl-Z in 2:1")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-be"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize(
    "text", ["WT1", SETUP.decode() + "WT100 ; caf\u00e9 \u4e2d\n", "WT1 ; \u011a \u1a00\r\n"]
)
def test_text_of_wide_characters_is_read(encoding, mark, text):
    data = (mark * encoding.endswith("e") + text).encode(encoding)
    source = source_from_bytes(data, "X.CMD")
    assert (source.text, source.encoded) == (text, data)
    assert source.sha256 == hashlib.sha256(data).hexdigest()
    assert lower(parse(source)).ops == lower(parse(Source("X.CMD", text))).ops


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be", "utf-32-le"])
def test_a_ctrl_z_is_a_character_of_any_encoding(encoding):
    source = source_from_bytes("WT1 ; \u1a1a\r\n\x1aWT2".encode(encoding), "X.CMD")
    assert source.text == "WT1 ; \u1a1a\r\n"
    assert (source.cut.line, source.cut.column) == (2, 1)


@pytest.mark.parametrize("data", [("WT100\n" * 9).encode("utf-16") + b"W", b"\xff\xfe\x00\xd8W\0"])
def test_wide_text_that_is_cut_is_told_with_its_byte(data):
    with pytest.raises(SourceError, match=r"at byte \d+ is no character") as raised:
        source_from_bytes(data, "X.CMD")
    (found,) = raised.value.diagnostics
    assert (found.rule, "save it as UTF-8" in found.hint) == ("wide-text", True)


def test_text_with_the_mark_of_utf_8_is_read():
    assert source_from_bytes(b"\xef\xbb\xbfWT1\n", "X.CMD").text == "WT1\n"
