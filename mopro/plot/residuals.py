"""A series before and after a diagnosis, as a figure."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from mopro.diagnosis import Series
from mopro.diagnosis.model import Floats
from mopro.recording.figure import mark_lines
from mopro.text import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Each bucket is drawn as its least and greatest value; a picture has no more columns.
_BUCKETS = 900
# Half width of the noise band, in σ of the sensor.
_BAND = 2.0
_SUM = "all of them"
_COLORS = ("tab:orange", "tab:green", "tab:red", "tab:purple")


def plot_residuals(
    series: Series, before: Floats, signatures: Mapping[str, Floats], after: Floats
) -> Figure:
    """Residuals of `series` before and after the fit, the signatures over the former.

    All in the unit of the series and of its length. Against time with the source lines
    marked, or row by row for a table; the band is twice the sensor's noise.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    shown = dict(signatures)
    if len(shown) > 1:
        shown[_SUM] = before - after
    draw = _draw_rows if series.time_s is None else _draw_in_time
    draw(upper, series, before, shown)
    draw(lower, series, after, {})
    upper.set_ylabel(plain(f"before ({series.unit})"))
    lower.set_ylabel(plain(f"after ({series.unit})"))
    lower.set_xlabel("row" if series.time_s is None else "time (s)")
    for panel in (upper, lower):
        panel.grid(alpha=0.3)
        if series.sigma:
            reach = _BAND * series.sigma
            panel.axhspan(-reach, reach, color="0.9", zorder=0, label=f"±{_BAND:g} σ of the sensor")
    if series.time_s is not None and source_lines(series):
        mark_lines(upper, series.time_s.tolist(), series.labels["line"].tolist())
    figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.suptitle(plain(f"{series.run}, {series.sensor}"))
    return figure


def source_lines(series: Series) -> list[int]:
    """The source lines that run while `series` is measured, ascending.

    Empty for a logged command (line 0) and for a table.
    """
    lines = np.unique(np.asarray(series.labels.get("line", ()), dtype=np.int64))
    return [int(line) for line in lines if line > 0]


def _draw_in_time(
    panel: Axes, series: Series, residual: Floats, signatures: Mapping[str, Floats]
) -> None:
    assert series.time_s is not None, "a series without times is drawn row by row"
    panel.plot(
        *envelope(series.time_s, residual), color="tab:blue", linewidth=0.5, label="residual"
    )
    for (name, change), color in zip(signatures.items(), _colors(signatures), strict=True):
        panel.plot(
            *envelope(series.time_s, change), color=color, linewidth=1.6, label=plain(name),
            linestyle="--" if name == _SUM else "-",
        )  # fmt: skip


def _draw_rows(
    panel: Axes, series: Series, residual: Floats, signatures: Mapping[str, Floats]
) -> None:
    rows = np.arange(1, len(series) + 1)
    panel.bar(rows, residual, color="tab:blue", alpha=0.5, label="residual")
    for (name, change), color in zip(signatures.items(), _colors(signatures), strict=True):
        panel.plot(rows, change, color=color, marker="o", linestyle="none", label=plain(name))
    panel.set_xticks(rows)


def _colors(signatures: Mapping[str, Floats]) -> list[str]:
    palette = cycle(_COLORS)
    return ["black" if name == _SUM else next(palette) for name in signatures]


def envelope(time_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Times and values thinned to the least and greatest value in each of _BUCKETS intervals.

    Drawn, they look like all the values.
    """
    size = -(-len(values) // _BUCKETS)
    if size <= 2:
        return time_s, values
    starts = np.arange(0, len(values), size)
    chosen = {0, len(values) - 1}
    for start in starts.tolist():
        part = values[start : start + size]
        chosen |= {start + int(part.argmin()), start + int(part.argmax())}
    at = np.array(sorted(chosen))
    return time_s[at], values[at]
