"""Texts from outside in figures: shown as they stand, whatever they look like."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from mopro.recording.shown_figure import figure_bytes
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


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
@pytest.mark.parametrize(
    "text", ["\u8a66\u9a13.CMD", "\ud55c\uad6d", "a\u4e2db", "\U0001f9ea $x$", "\u0e44\u0e17\u0e22"]
)
@pytest.mark.filterwarnings("error")
def test_characters_that_the_font_lacks_are_written_as_escapes(text, form):
    figure = figure_titled(text)
    axes = figure.subplots()
    axes.plot([0, 1], label=plain(text))
    axes.set_xlabel(plain(text))
    axes.legend()
    assert len(figure_bytes(figure, form)) > 500
    (title,) = figure.texts
    assert title.get_text().isascii()
    assert title.get_text() == plain(text).encode("unicode_escape").decode().replace(r"\\$", r"\$")


@pytest.mark.parametrize(
    "text",
    [
        "caf\u00e9",
        "\u03c3 of \u0394x",
        "\u041f\u0440\u0438\u0432\u0435\u0442",
        "1 \u2013 2 \u00b5m",
        "a\nb\u00b2",
    ],
)
@pytest.mark.filterwarnings("error")
def test_characters_that_the_font_has_stay_as_they_are(text):
    figure = figure_titled(text)
    figure_bytes(figure, "png")
    (title,) = figure.texts
    assert title.get_text() == text
