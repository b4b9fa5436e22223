"""Figure of a recording's columns over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mopro.text import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_UM_PER_M = 1e6
_MM_PER_M = 1e3
_AXIS_COLORS = {1: "tab:blue", 2: "tab:orange"}
_MOST_LINE_MARKS = 40


def draw(columns: Mapping[str, NDArray[Any]], axes: Sequence[int], title: str) -> Figure:
    """Position, velocity, following error, force and temperature over time.

    `columns` are those of a recording of `axes`. Axes that never move are left out. The top
    edge names the source lines.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 10), layout="constrained")
    panels = figure.subplots(5, 1, sharex=True)
    time = columns["time_s"]
    for n in _moving_axes(columns, axes):
        style = {"color": _AXIS_COLORS[n], "label": f"axis {n}", "linewidth": 1.0}
        lag = columns[f"command_{n}_m"] - columns[f"position_{n}_m"]
        panels[0].plot(time, columns[f"position_{n}_m"] * _MM_PER_M, **style)
        panels[1].plot(time, columns[f"velocity_{n}_m_s"], **style)
        panels[2].plot(time, lag * _UM_PER_M, **style)
        panels[3].plot(time, columns[f"force_{n}_N"], **style)
    panels[4].plot(time, columns["temperature_C"], color="tab:red", linewidth=1.0)
    labels = (
        "position (mm)",
        "velocity (m/s)",
        "following error (µm)",
        "force (N)",
        "temperature (°C)",
    )
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    panels[0].legend(loc="upper right")
    panels[-1].set_xlabel("time (s)")
    mark_lines(panels[0], time.tolist(), columns["line"].tolist())
    figure.suptitle(plain(title))
    return figure


def _moving_axes(columns: Mapping[str, NDArray[Any]], axes: Sequence[int]) -> Sequence[int]:
    return [n for n in axes if np.ptp(columns[f"command_{n}_m"]) > 0] or axes


def mark_lines(panel: Axes, time_s: Sequence[float], lines: Sequence[int]) -> None:
    """Mark each change of the source line at the top of `panel`, unless there are too many."""
    starts = [0]
    for _, group in groupby(lines):
        starts.append(starts[-1] + sum(1 for _ in group))
    if len(starts) > _MOST_LINE_MARKS:
        return
    for start in starts[:-1]:
        t = float(time_s[start])
        panel.axvline(t, color="0.8", linewidth=0.8, zorder=0)
        panel.annotate(
            f"line {lines[start]}", (t, 1.01), xycoords=("data", "axes fraction"), fontsize=7
        )
