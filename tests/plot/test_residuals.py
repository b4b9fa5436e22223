"""Figures of series that are too long to be drawn point by point."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mopro.diagnosis import Series
from mopro.plot.residuals import envelope, plot_residuals


@given(arrays(float, st.integers(2, 5000), elements=st.floats(-1e3, 1e3)))
def test_an_envelope_is_of_the_samples_and_keeps_ends_and_extremes(values):
    times = np.arange(len(values)) / 1000.0
    drawn_at, drawn = envelope(times, values)
    assert (np.diff(drawn_at) > 0).all()
    assert (drawn == values[np.searchsorted(times, drawn_at)]).all()
    assert (drawn_at[0], drawn_at[-1]) == (times[0], times[-1])
    assert (drawn.min(), drawn.max()) == (values.min(), values.max())


def test_a_spike_of_one_sample_among_a_million_is_drawn_and_little_else():
    values = np.zeros(1_000_000)
    values[654_321] = 1.0
    times, drawn = envelope(np.arange(1e6), values)
    assert times[drawn == 1.0] == [654_321]
    assert len(drawn) < 2_000


def test_both_residuals_each_signature_their_sum_and_the_lines_are_in_the_figure():
    times = np.linspace(0, 1, 100)
    lines = np.repeat([4, 7], 50)
    series = Series("fast.csv", "laser", "in", times, 0.1, times, labels={"line": lines})
    signatures = {"drag": times / 2, "spring": times / 4}
    upper, lower = plot_residuals(series, times, signatures, times / 4).axes
    drawn = {line.get_label(): line for line in upper.get_lines()}
    assert {"residual", "drag", "spring", "all of them"} <= set(drawn)
    assert np.allclose(drawn["all of them"].get_ydata(), 0.75 * times)
    assert [note.get_text() for note in upper.texts] == ["line 4", "line 7"]
    assert (lower.get_lines()[0].get_ydata() == times / 4).all()
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("before (in)", "after (in)")


def test_a_table_has_a_bar_for_each_row():
    rises = np.array([3.0, -1.0, 2.0])
    series = Series("table.csv", "temperature", "K", rises, 1.0)
    upper, lower = plot_residuals(series, rises, {"radiation": rises / 2}, rises / 2).axes
    (bars,), (after,) = upper.containers, lower.containers
    assert [bar.get_height() for bar in bars] == [3.0, -1.0, 2.0]
    assert [bar.get_height() for bar in after] == [1.5, -0.5, 1.0]
    assert lower.get_xlabel() == "row"
