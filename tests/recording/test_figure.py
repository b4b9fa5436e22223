"""The figure of a recording: units, phases, lines, and what is left out."""

from dataclasses import replace

import numpy as np
import pytest

import mopro
from mopro.recording import Recording, Stall
from mopro.recording.envelope import HEAD, MOST_BUCKETS

TEXT = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 3.0\nWX1\nWT100\nMRI1 -1.0\nWX1\n"


@pytest.fixture(scope="module")
def recording():
    return mopro.emulate(mopro.compile(TEXT, "P.CMD"), payload_kg=2.0)


def panels_of(figure):
    return {panel.get_ylabel(): panel for panel in figure.axes if panel.get_ylabel()}


def drawn(panel):
    return {line.get_label(): line for line in panel.get_lines()}


def test_lengths_are_in_the_unit_of_the_program(recording):
    panels = panels_of(recording.plot())
    assert list(panels) == [
        "position (in)", "speed (in/s)", "lag (in)", "stall margin (%)", "force (N)",
        "phase currents (A)", "temperature (°C)",
    ]  # fmt: skip
    position = drawn(panels["position (in)"])["position"].get_ydata()
    assert position.max() == pytest.approx(3.0, abs=0.02)
    speed = drawn(panels["speed (in/s)"])["speed"].get_ydata()
    assert speed.max() == pytest.approx(recording["velocity_1_m_s"].max() / 0.0254)
    lag = drawn(panels["lag (in)"])["lag"].get_ydata()
    own = recording["command_1_m"] - recording["position_1_m"]
    assert np.allclose(lag, own / 0.0254)


def test_another_unit_may_be_asked_for_and_must_be_a_length(recording):
    panels = panels_of(recording.plot("mm"))
    assert {"position (mm)", "speed (mm/s)", "lag (mm)"} <= set(panels)
    with pytest.raises(ValueError, match="'kg' is not a unit of length, such as in or mm"):
        recording.plot("kg")


def test_phases_are_shaded_and_lines_are_named(recording):
    figure = recording.plot()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["accelerate", "decelerate"]
    assert len(figure.axes[0].patches) == 4
    names = [note.get_text() for note in figure.axes[0].texts]
    assert names == ["line 4", "line 6", "line 7"]
    margins = panels_of(figure)["stall margin (%)"].collections[0].get_segments()
    expected = [100 * move.stall_margin for move in recording.run.moves]
    assert [segment[0][1] for segment in margins] == pytest.approx(expected)


def test_what_is_absent_or_never_seen_is_not_drawn(recording):
    unseen = {"force_1_N", "temperature_C"}
    columns = {
        name: np.full(len(recording), np.nan) if name in unseen else values
        for name, values in recording.columns.items()
        if not name.startswith("phase")
    }
    figure = Recording(recording.header, columns).plot()
    assert list(panels_of(figure)) == ["position (mm)", "speed (mm/s)", "lag (mm)"]


def test_a_recording_of_nothing_is_refused_in_words(recording):
    with pytest.raises(ValueError, match="no readings that could be drawn"):
        Recording(recording.header, {"time_s": recording["time_s"]}).plot()


def test_a_legend_is_above_the_curves(recording):
    panel = panels_of(recording.plot())["position (in)"]
    panel.figure.draw_without_rendering()
    legend = panel.get_legend().get_window_extent().transformed(panel.transData.inverted())
    assert legend.y0 > max(max(line.get_ydata()) for line in panel.get_lines())


def test_the_title_of_a_long_run_of_many_moves_is_within_the_figure(recording):
    columns = {name: np.tile(values, 100) for name, values in recording.columns.items()}
    columns["time_s"] = np.arange(len(columns["time_s"])) / 2000.0
    assert len(columns["time_s"]) > MOST_BUCKETS
    moves = tuple(replace(recording.run.moves[0], line=n) for n in (16, 19, 21, 23) * 900)
    many = Recording(recording.header, columns, replace(recording.run, moves=moves))
    figure = many.plot()
    figure.draw_without_rendering()
    title = figure._suptitle.get_window_extent()
    assert "areas reach" in figure._suptitle._text
    assert 0 < title.x0 < title.x1 < figure.bbox.width


def test_few_samples_are_dots(recording):
    few = {name: values[::100] for name, values in recording.columns.items()}
    assert Recording(recording.header, few).plot().axes[0].get_lines()[0].get_marker() == "."
    assert recording.plot().axes[0].get_lines()[0].get_marker() == "None"


def test_a_long_run_is_an_area_beside_its_beginning(recording):
    count, period_s = 100_000, 1.7
    time_s = np.arange(count) / 2000.0
    lag_m = 1e-5 * np.sin(2 * np.pi * time_s / period_s)
    lag_m[77_777] = 3e-4
    columns = {"time_s": time_s, "command_1_m": np.abs(lag_m), "position_1_m": 0 * time_s}
    columns["position_1_m"] = columns["command_1_m"] - lag_m
    long = Recording(recording.header, columns)
    figure = long.plot()
    whole, beginning = figure.axes[2], figure.axes[3]
    highest = max(line.get_ydata().max() for line in whole.get_lines())
    assert highest == pytest.approx(0.3)
    assert max(len(line.get_xdata()) for line in whole.get_lines()) <= 1000
    assert len(beginning.get_lines()[0].get_xdata()) == HEAD
    assert "areas reach from the least to the greatest of each 2 samples" in figure._suptitle._text


def test_many_moves_are_counted_in_place_of_being_marked(recording):
    moves = tuple(replace(recording.run.moves[0], start_s=i * 1e-3) for i in range(41))
    many = replace(recording, run=replace(recording.run, moves=moves))
    figure = many.plot()
    assert not figure.legends
    assert figure._suptitle._text == ("P.CMD on chow1992\n41 moves, too many to mark (line 4 × 41)")


def test_a_stall_is_marked_when_it_happened_or_else_where_its_move_ends(recording):
    first, second = recording.run.moves
    run = replace(recording.run, moves=(first, replace(second, slipped=True)))
    seen = replace(run, stalls=(Stall(0.02, 7, 1, 3),))
    for each, at_s in ((run, second.start_s + second.duration_s), (seen, 0.02)):
        panel = panels_of(replace(recording, run=each).plot())["temperature (°C)"]
        assert drawn(panel)["stall"].get_xdata() == pytest.approx([at_s, at_s])


@pytest.mark.parametrize("name", [r"$\frac{$.CMD", "a_b^{.CMD", "x\x1b[31m.CMD"])
def test_any_name_is_shown_as_text(recording, name):
    odd = replace(recording, header=replace(recording.header, program=name))
    picture = odd.plot()._repr_png_()
    assert picture.startswith(b"\x89PNG")
