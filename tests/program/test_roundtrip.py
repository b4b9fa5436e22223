"""IR and canonical text are two forms of one program."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mopro
from mopro.program import statements
from mopro.testing import programs


@given(programs("extended"))
def test_canonical_text_compiles_to_the_same_program(program):
    written = statements.canonical(program)
    again = mopro.compile(written, grammar="extended")
    assert again == program
    assert statements.canonical(again) == written


@given(programs())
def test_spans_survive_lowering(program):
    lines = [op.span.line for op in program.ops]
    assert lines == sorted(set(lines))


def test_equality_is_of_meaning_and_not_of_place():
    assert mopro.compile("GO") == mopro.compile("\n\n  go ; now")
    assert mopro.compile("WT1") != mopro.compile("WT2")


def test_assumed_statements_have_canonical_text_too():
    written = "MAI1 1.0\nMA0 -2.0\nMC2 3.5\nSK1 -4.0\nST0\nHM2\n"
    assert statements.canonical(mopro.compile(written, grammar="extended")) == written


@given(st.integers(-(10**12), 10**12), st.integers(0, 12))
def test_decimals_are_exact(n, digits):
    value = Fraction(n, 10**digits)
    written = statements.decimal(value)
    assert Fraction(written) == value
    assert "." in written


def test_what_is_no_decimal_is_refused():
    with pytest.raises(ValueError, match="not a plain decimal"):
        statements.decimal(Fraction(1, 3))
