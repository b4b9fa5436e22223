"""Texts from outside in figures: shown as they stand, whatever they look like."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from mopro.plot.figure import figure_bytes
from mopro.text import plain

ODD = ["dollar$x_{$.CMD", r"$\frac{$", "$$", r"\$x_{\$", "$a$ $b$", "_hidden", "\udce9\n\0"]


def figure_titled(text):
    figure = Figure(figsize=(2, 1))
    figure.suptitle(plain(text))
    return figure


@pytest.mark.parametrize("text", ODD)
@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_no_text_keeps_a_figure_from_being_drawn(text, form):
    assert len(figure_bytes(figure_titled(text), form)) > 500


@given(st.text(alphabet="$\\{}_^ax", max_size=12))
def test_what_is_shown_is_the_text_itself(text):
    (title,) = figure_titled(text).texts
    assert title._preprocess_math(title.get_text()) == (text, False)
