"""A sweep as a figure: a map of the force margin, or the margin against the time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mopro.recording.figure import BLACK, BLUE, VERMILLION
from mopro.recording.style import library_style
from mopro.sweeps.designs import GRID
from mopro.sweeps.figures import OK, REFUSED
from mopro.sweeps.run import Sweep
from mopro.sweeps.varied import Varied
from mopro.text import plain

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.axes import Axes

    from mopro.recording.shown_figure import ShownFigure

Floats = NDArray[np.float64]
_MARGIN = "least force margin (%)"


@library_style()
def plot_sweep(sweep: Sweep, table: pa.Table, title: str) -> ShownFigure:
    """Figure of the `table` of a sweep.

    A grid of two quantities is a map of the least force margin, with the border beyond which runs
    stall or trip; any other is the margin of each run against its time, with those that no other
    beats in both.
    """
    from mopro.recording.shown_figure import ShownFigure

    figure = ShownFigure(figsize=(8, 5.5), layout="constrained")
    panel = figure.subplots()
    several = [each for each in sweep.subject.varied if len(each.levels) > 1]
    if sweep.design.kind == GRID and len(several) == 2:
        _draw_map(figure, panel, several, table)
    else:
        _draw_margins(panel, table)
    figure.suptitle(plain(title))
    return figure


def _column(table: pa.Table, name: str) -> Any:
    return np.array(table[name].to_pylist())


def _draw_map(figure: ShownFigure, panel: Axes, varied: Sequence[Varied], table: pa.Table) -> None:
    """The first quantity to the right, the second one upwards; refused runs are left white."""
    x, y = (_places(each) for each in varied)
    shown = np.ix_(np.argsort(x), np.argsort(y))
    outcome = _column(table, "outcome").reshape(len(x), len(y))[shown].T
    margin = 100 * _numbers(table, "force_margin").reshape(len(x), len(y))[shown].T
    margin[(outcome != OK) & (outcome != REFUSED)] = 0.0
    x, y = np.sort(x), np.sort(y)
    drawn = panel.pcolormesh(x, y, margin, shading="nearest", cmap="viridis", vmin=0, vmax=100)
    figure.colorbar(drawn, ax=panel, label=_MARGIN)
    failed = (outcome != OK).astype(float)
    if failed.any() and not failed.all():
        panel.contour(x, y, failed, levels=[0.5], colors=VERMILLION, linewidths=2)
        panel.plot([], [], color=VERMILLION, linewidth=2, label="border of stalls and trips")
        panel.legend(loc="best")
    for each, places, axis in zip(varied, (x, y), (panel.xaxis, panel.yaxis), strict=True):
        axis.set_label_text(plain(each.name + (f" ({each.unit})" if each.unit else "")))
        if each.target.choices:
            axis.set_ticks(places.tolist(), [plain(str(level)) for level in each.levels])


def _places(varied: Varied) -> Floats:
    """Where the levels stand on an axis: choices one beside the other."""
    if varied.target.choices:
        return np.arange(float(len(varied.levels)))
    return np.array([float(level) for level in varied.levels])


def _numbers(table: pa.Table, name: str) -> Floats:
    numbers: Floats = _column(table, name).astype(float)
    return numbers


def _draw_margins(panel: Axes, table: pa.Table) -> None:
    time_s, margin = _numbers(table, "time_s"), 100 * _numbers(table, "force_margin")
    outcome = _column(table, "outcome")
    ok = (outcome == OK) & np.isfinite(margin)
    failed = ~ok & (outcome != REFUSED) & np.isfinite(time_s)
    panel.plot(time_s[ok], margin[ok], ".", color=BLUE, label="a run")
    if failed.any():
        at_0 = np.zeros(int(failed.sum()))
        panel.plot(time_s[failed], at_0, "x", color=VERMILLION, label="stalled, tripped")
    best = _unbeaten(time_s[ok], margin[ok])
    panel.step(
        time_s[ok][best], margin[ok][best], where="post", color=BLACK, marker="o", markersize=3,
        label="no other is both sooner and safer",
    )  # fmt: skip
    panel.set_xlabel("time of the program (s)")
    panel.set_ylabel(_MARGIN)
    panel.grid(alpha=0.3)
    panel.legend(loc="best")


def _unbeaten(time_s: Floats, margin: Floats) -> NDArray[np.intp]:
    """The indices of the runs that no other beats in time and margin, soonest first."""
    order = np.lexsort((-margin, time_s))
    highest = np.maximum.accumulate(np.append(-np.inf, margin[order]))[:-1]
    return order[margin[order] > highest]
