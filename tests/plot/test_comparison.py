"""The figure of a comparison: measured over simulated, the residual below."""

import json

import numpy as np
import pytest

from helpers.paths import PROGRAMS
from mopro.engine import Series
from mopro.experiment.comparison import Compared, Comparison, SeriesTest
from mopro.experiment.opened import open_experiment
from mopro.plot.comparison import plot_comparison

TABLE = PROGRAMS / "thermal" / "experiment.toml"


def one_series(sigma, name="run.csv"):
    return SeriesTest(name, "laser", "in", 4, 2.0, 1.0, sigma, 0.1, 0.2, True)


def comparison_of(*sigmas):
    tests = [one_series(sigma, f"{i}.csv") for i, sigma in enumerate(sigmas)]
    times, measured = np.arange(4.0), np.array([0.0, 1.0, 2.0, 3.0])
    lines = {"line": np.array([3, 3, 5, 5], np.int32)}
    series = Series("run.csv", "laser", "in", measured, 1.0, times, labels=lines)
    return Comparison.of([], tests, [Compared(series, np.full(4, 0.5))] * len(sigmas))


def test_both_curves_the_residual_and_the_lines_are_in_the_figure():
    comparison = comparison_of(2.0)
    upper, lower = plot_comparison(comparison, "e.toml on m", comparison).axes
    curves = {line.get_label(): line.get_ydata() for line in upper.get_lines()}
    assert curves["measured"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert curves["simulated"].tolist() == curves["simulated before"].tolist()
    assert [note.get_text() for note in upper.texts] == ["line 3", "line 5"]
    residuals = {line.get_label(): line.get_ydata().tolist() for line in lower.get_lines()}
    assert residuals == {"before": [0.5] * 4, "residual": [0.5] * 4}
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("laser (in)", "residual (in)")


def test_of_many_series_the_worst_are_drawn_and_it_is_said():
    figure = plot_comparison(comparison_of(1, 2, 3, 4, 5, 6, 7, 8), "e.toml on m")
    assert len(figure.axes) == 12
    assert "the 6 of 8 series with the largest residuals" in figure._suptitle._text


@pytest.mark.parametrize("name", [r"$\frac{$", "$$"])
def test_names_are_text(name):
    comparison = Comparison.of([], [one_series(1.0, name)], comparison_of(1.0).compared)
    assert plot_comparison(comparison, name)._repr_png_().startswith(b"\x89PNG")


def test_samples_are_of_the_series_and_not_in_the_json():
    comparison = open_experiment(TABLE).compare(0)
    (compared,) = comparison.compared
    assert compared.series.values.tolist()[:2] == [25.4884, 21.3867]
    size = float(np.sqrt(np.mean(compared.residual**2)))
    assert size == pytest.approx(comparison.series[0].rms)
    keys = {"verdict", "where", "series", "calibration", "notes"}
    assert comparison.as_json().keys() == keys


def test_the_command_draws_and_keeps_its_inputs(mopro, tmp_path):
    done = mopro("compare", TABLE, "--plot", "c.svg", "--json")
    assert (done.returncode, done.stderr) == (1, "")
    assert json.loads(done.stdout)["verdict"] == "disagreement"
    assert (tmp_path / "c.svg").read_bytes().startswith(b"<?xml")
    (tmp_path / "full.png").symlink_to("/dev/full")
    done = mopro("compare", TABLE, "--plot", "full.png", "--json")
    assert (done.returncode, json.loads(done.stdout)["verdict"]) == (1, "disagreement")
    assert "full.png: not drawn: " in done.stderr
    data = PROGRAMS / "thermal" / "table-3-2.csv"
    (tmp_path / "m.png").symlink_to(data)
    done = mopro("compare", TABLE, "--plot", "m.png")
    assert done.returncode == 2
    assert "--plot would overwrite" in done.stderr
