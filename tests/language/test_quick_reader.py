"""Lines read by patterns made of the grammar are what lark makes of them, to the last column."""

import importlib

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

PARSE = importlib.import_module("mopro.language.parse")
READERS = {grammar: PARSE._reader(grammar) for grammar in PARSE.GRAMMARS}
PIECES = [
    "MRI", "MR", "mri", "VEL", "ACC", "WX", "WT", "GO", "UU", "PARA", "JUMP", "ZP", "MC",
    "VI", "LX", ":", "B1", "0", "1", "9", "O", "o", "12500", "/", "+", "-", "5.", ".5",
    "1.25", ".", " ", "\t",
    "\v", ";", "; go", "\x1c", "é", "x_2", "1" * 40,
]  # fmt: skip
LINES = st.one_of(
    st.lists(st.sampled_from(PIECES), max_size=9).map("".join),
    st.builds(
        "{}{}{} {}{}".format,
        st.sampled_from(PIECES[:16]), st.sampled_from("012Oo"), st.sampled_from(["", " "]),
        st.decimals(-99, 99, places=4), st.sampled_from(["", " ", ";", " ; back"]),
    ),
)  # fmt: skip


@pytest.mark.parametrize("grammar", list(PARSE.GRAMMARS))
@settings(max_examples=400)
@given(text=LINES)
@example(text="MRI1 -15.0 ; back")
@example(text="UU0 12500 / 1")
@example(text="JUMP MRI;")
@example(text=":WX1")
@example(text="MRI1 5\n")
def test_a_line_is_read_as_lark_reads_it(grammar, text):
    quick, lark = READERS[grammar].quick(text.partition(";")[0]), PARSE._read_by_lark(grammar, text)
    assert quick is None or quick == lark.statement


@settings(max_examples=400)
@given(text=LINES)
@example(text=" :WX1 ; back")
@example(text="MRI1 " + "1" * 40)
def test_a_statement_is_known_for_one(text):
    assert PARSE.is_statement(text) == (PARSE._read_by_lark("extended", text).statement is not None)


@pytest.mark.parametrize(
    "text", ["MRI1 15.0", "  velo 15.0;x", "UU012500/1", ":B1", "JUMP B1 ; b", "GO"]
)
def test_a_statement_needs_no_lark(text):
    assert READERS["attested"].quick(text.partition(";")[0]) is not None
