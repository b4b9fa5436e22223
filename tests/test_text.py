"""Text from outside is shown, and does nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mopro.errors import Diagnostic, MoproError
from mopro.markup import listing, table
from mopro.source import Source, Span
from mopro.text import plain, visible
from mopro.viewer.page import document


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("line 1\n\tline 2: σ = 5 µm", "line 1\n\tline 2: σ = 5 µm"),
        ("\x1b]0;title\x07", "\\x1b]0;title\\x07"),
        ("a\u202eb\u2066c", "a\\u202eb\\u2066c"),
        ("back\rspace\b", "back\\rspace\\x08"),
        ("\ud800", "\\ud800"),
        ("\x9b31m", "\\x9b31m"),
        ("zero\u200bwidth\ufeff", "zero\\u200bwidth\\ufeff"),
    ],
)
def test_what_is_not_shown_as_itself_is_an_escape(text, shown):
    assert visible(text) == shown


@given(st.text(st.characters()))
def test_nothing_but_printable_text_is_left(text):
    shown = visible(text)
    assert all(c.isprintable() or c in "\n\t" for c in shown)
    assert visible(shown) == shown.encode("utf-8").decode("utf-8")


def test_errors_findings_pages_and_labels_use_it():
    odd = "\x1b\u202e<b>$x$"
    finding = Diagnostic("rule", odd, Span(1, 1, 2), hint=odd)
    said = [
        finding.message, finding.hint, finding.render(Source(odd, f"VEL{odd}")),
        MoproError(odd).render(), document(odd, [], [], [listing(odd), table([odd], [[odd]], odd)]),
        plain(odd),
    ]  # fmt: skip
    for text in said:
        assert "\x1b" not in text
        assert "\u202e" not in text
        assert "\\x1b\\u202e" in text
    assert "<b>" not in said[4].split("<body>")[1].split("<script>")[0]
