"""Figure of a recording's columns over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mopro.text import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Trace = Callable[[Mapping[str, NDArray[Any]], int], list[NDArray[Any]]]

_UM_PER_M = 1e6
_MM_PER_M = 1e3
_AXIS_COLORS = {1: "tab:blue", 2: "tab:orange"}
_MOST_LINE_MARKS = 40


def draw(columns: Mapping[str, NDArray[Any]], axes: Sequence[int], title: str) -> Figure:
    """Position, velocity, following error, force and temperature over time.

    `columns` are those of a recording of `axes`. Axes that never move are left out, and so are
    panels of columns that the recording has not. The top edge names the source lines.
    """
    from matplotlib.figure import Figure

    time = columns["time_s"]
    traces = {
        label: drawn
        for label, trace in _TRACES.items()
        if (drawn := [(n, y) for n in _moving_axes(columns, axes) if (y := trace(columns, n))])
    }
    heated = "temperature_C" in columns
    count = len(traces) + heated
    figure = Figure(figsize=(10, 2 * count), layout="constrained")
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for panel, (label, drawn) in zip(panels, traces.items(), strict=False):
        panel.set_ylabel(label)
        for n, (values,) in drawn:
            panel.plot(time, values, color=_AXIS_COLORS[n], label=f"axis {n}", linewidth=1.0)
    if heated:
        panels[-1].set_ylabel("temperature (°C)")
        panels[-1].plot(time, columns["temperature_C"], color="tab:red", linewidth=1.0)
    for panel in panels:
        panel.grid(alpha=0.3)
    panels[0].legend(loc="upper right")
    panels[-1].set_xlabel("time (s)")
    mark_lines(panels[0], time.tolist(), columns["line"].tolist())
    figure.suptitle(plain(title))
    return figure


def _scaled(name: str, factor: float = 1.0) -> Trace:
    """The column `name` of an axis times `factor`."""

    def trace(columns: Mapping[str, NDArray[Any]], n: int) -> list[NDArray[Any]]:
        column = name.format(n)
        return [columns[column] * factor] if column in columns else []

    return trace


def _position(columns: Mapping[str, NDArray[Any]], n: int) -> list[NDArray[Any]]:
    """The position of an axis, or else its command."""
    return _scaled("position_{}_m", _MM_PER_M)(columns, n) or _scaled("command_{}_m", _MM_PER_M)(
        columns, n
    )


def _lag(columns: Mapping[str, NDArray[Any]], n: int) -> list[NDArray[Any]]:
    if f"command_{n}_m" not in columns or f"position_{n}_m" not in columns:
        return []
    return [(columns[f"command_{n}_m"] - columns[f"position_{n}_m"]) * _UM_PER_M]


# label of a panel -> its trace of an axis: no array where the recording has not the columns
_TRACES: dict[str, Trace] = {
    "position (mm)": _position,
    "velocity (m/s)": _scaled("velocity_{}_m_s"),
    "following error (µm)": _lag,
    "force (N)": _scaled("force_{}_N"),
}


def _moving_axes(columns: Mapping[str, NDArray[Any]], axes: Sequence[int]) -> Sequence[int]:
    moving = []
    for n in axes:
        own = [columns[c] for c in (f"command_{n}_m", f"position_{n}_m") if c in columns]
        if any(np.nanmax(values) > np.nanmin(values) for values in own):
            moving.append(n)
    return moving or axes


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
