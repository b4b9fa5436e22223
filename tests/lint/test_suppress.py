"""Allowed findings stay quiet; allowances that allow nothing do not."""

import pytest

from mopro.lint import Settings, lint
from mopro.source import Source

READY = "UU012500/1\nVEL0 40.0\nACC0 1.9\n"


def found(text, **settings):
    return [(f.rule, f.span.line) for f in lint(Source("x", text), Settings(**settings))]


@pytest.mark.parametrize(
    "text",
    [
        "VELO 1.0 ; mopro: allow letter-o-axis\n",
        "; mopro: allow letter-o-axis\nVELO 1.0\n",
        "; mopro: allow letter-o-axis\n\n; a remark\nVELO 1.0\n",
        "VELO 1.0 ;MOPRO: Allow Letter-O-Axis\n",
        READY + "MRI1 15.0 ; mopro: allow stall\nWX1\n",
        READY + "MRI1 15.0 ; mopro: allow stall, end-without-wait\n",
        READY + "MRI1 15.0\nMRI1 1.0 ; mopro: allow move-on-moving-axis\nWX1\n",
    ],
)
def test_allowed(text):
    assert found(text) == []


def test_an_allowance_reaches_one_line_only():
    text = "; mopro: allow letter-o-axis\nVELO 1.0\nACCO 1.0\n"
    assert found(text) == [("letter-o-axis", 3)]


def test_unused_and_misspelt_allowances_are_told_at_their_name():
    text = "WT1 ; mopro: allow stall, stal\n"
    first, second = lint(Source("x", text), Settings())
    assert (first.rule, first.span.column, first.span.end_column) == ("unused-allow", 20, 25)
    assert (second.span.column, second.span.end_column) == (27, 31)
    assert "stall" in second.hint


def test_an_allowance_of_a_rule_that_is_not_asked_is_not_unused():
    text = "WT1 ; mopro: allow stall\n"
    assert found(text, ignore=frozenset({"stall"})) == []


def test_other_comments_allow_nothing():
    assert found("VELO 1.0 ; the manual says mopro: allow letter-o-axis\n") == [
        ("letter-o-axis", 1)
    ]
