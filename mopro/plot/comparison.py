"""A comparison as a figure: measured over simulated, and the residual below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mopro.engine.series import Series
from mopro.experiment.breaks import drawn
from mopro.experiment.comparison import Compared, Comparison, SeriesTest
from mopro.recording.envelope import Band, Floats
from mopro.recording.figure import BLACK, BLUE, VERMILLION, add_legend, draw_band, mark_lines
from mopro.recording.style import library_style
from mopro.text import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mopro.recording.shown_figure import ShownFigure

# Series of a figure, those whose residual is largest in σ.
_MOST_SERIES = 6
# Half width of the noise band, in σ of the sensor.
_BAND = 2.0
_MEASURED = {"color": "0.45", "linestyle": "-", "linewidth": 2.0}
_SIMULATED = {"color": BLUE, "linestyle": "--"}
_BEFORE = {"color": VERMILLION, "linestyle": ":"}
_RESIDUAL = {"color": BLACK, "linestyle": "-", "linewidth": 0.6}


@library_style()
def plot_comparison(
    comparison: Comparison, title: str, before: Comparison | None = None
) -> ShownFigure:
    """Two panels for each series: measured over simulated, and the residual with its noise.

    `before` is the comparison with another machine, whose simulation and residual are drawn
    beside. Of many series those with the largest residuals are drawn; the title tells how many.
    """
    from mopro.recording.shown_figure import ShownFigure

    chosen = _chosen(comparison)
    figure = ShownFigure(figsize=(10, 0.8 + 4.0 * len(chosen)), layout="constrained")
    parts = figure.subfigures(len(chosen), 1, squeeze=False)[:, 0]
    for part, index in zip(parts, chosen, strict=True):
        upper, lower = part.subplots(2, 1, sharex=True, height_ratios=[3, 2])
        test, compared = comparison.series[index], comparison.compared[index]
        earlier = before.compared[index] if before else None
        _draw_both(upper, compared, earlier)
        _draw_residual(lower, compared, earlier, test)
        upper.set_ylabel(plain(f"{test.sensor} ({test.unit})"))
        lower.set_ylabel(plain(f"residual ({test.unit})"))
        lower.set_xlabel("row" if compared.series.time_s is None else "time (s)")
        for panel in (upper, lower):
            panel.grid(alpha=0.3)
            add_legend(panel, 4)
        part.suptitle(plain(f"{test.run}: {_size(test)}"), fontsize=10)
    count = len(comparison.series)
    rest = f" (the {len(chosen)} of {count} series with the largest residuals)"
    figure.suptitle(plain(title) + (rest if len(chosen) < count else ""), fontsize=11)
    return figure


def _chosen(comparison: Comparison) -> list[int]:
    """Indices of the series that are drawn, ascending."""
    tests = comparison.series
    order = sorted(range(len(tests)), key=lambda i: -(tests[i].sigma or 0.0))
    return sorted(order[:_MOST_SERIES])


def _size(test: SeriesTest) -> str:
    """RMS of the residual of a series, in words."""
    words = f"residual {test.rms:.3g} {test.unit} RMS"
    return words if test.noise_rms is None else f"{words}, noise {test.noise_rms:.3g} {test.unit}"


def _simulated(compared: Compared) -> Floats:
    """The simulation, with the offset that was taken out of the residual."""
    simulated: Floats = compared.series.values - compared.residual
    return simulated


def _draw_both(panel: Axes, compared: Compared, before: Compared | None) -> None:
    """Measured and simulated values, in time or row by row."""
    series = compared.series
    if series.time_s is None:
        rows = np.arange(1, len(series) + 1)
        panel.plot(rows, series.values, "o", color=BLACK, label="measured")
        panel.plot(rows, _simulated(compared), "x", color=BLUE, label="simulated")
        if before is not None:
            panel.plot(rows, _simulated(before), "+", color=VERMILLION, label="simulated before")
        panel.set_xticks(rows)
        return
    draw_band(panel, _band(series, series.values), "measured", _MEASURED)
    if before is not None:
        draw_band(panel, _band(series, _simulated(before)), "simulated before", _BEFORE)
    draw_band(panel, _band(series, _simulated(compared)), "simulated", _SIMULATED)
    if "line" in series.labels:
        mark_lines(panel, series.time_s.tolist(), np.asarray(series.labels["line"]).tolist())


def _draw_residual(
    panel: Axes, compared: Compared, before: Compared | None, test: SeriesTest
) -> None:
    """Measured minus simulated, over a band of twice the sensor's noise."""
    if test.noise_rms:
        reach = _BAND * test.noise_rms
        panel.axhspan(-reach, reach, color="0.88", zorder=0, label=f"±{_BAND:g} σ of the sensor")
    series = compared.series
    if series.time_s is None:
        rows = np.arange(1, len(series) + 1)
        if before is not None:
            panel.bar(rows, before.residual, color=VERMILLION, alpha=0.4, label="before")
        panel.bar(rows, compared.residual, width=0.4, color=BLUE, label="residual")
        return
    if before is not None:
        draw_band(panel, _band(series, before.residual), "before", _BEFORE)
    draw_band(panel, _band(series, compared.residual), "residual", _RESIDUAL)


def _band(series: Series, values: Floats) -> Band:
    """Values of a series in time, with a break where it has no readings."""
    shown = drawn(series)
    return Band.of(shown.time_s, shown.of(values))
