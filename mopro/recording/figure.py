"""Figure of a recording's columns over time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from mopro.recording.envelope import LAG, Band, Envelopes, Floats
from mopro.recording.moves import MoveReport, folded
from mopro.recording.run import Run
from mopro.recording.style import library_style
from mopro.text import plain
from mopro.units import UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mopro.recording.shown_figure import ShownFigure


ACCELERATE, CRUISE, DECELERATE = "accelerate", "cruise", "decelerate"
PHASES = (ACCELERATE, CRUISE, DECELERATE)
# Duration of a ramp to velocity v at acceleration a, as a multiple of v/a: a parabolic ramp
# takes twice as long. The other profiles have no cruise.
_RAMP = {"trapezoid": 1.0, "smooth": 2.0}


@dataclass(frozen=True)
class Phase:
    """One of `PHASES`, from `start_s` to `end_s`."""

    name: str
    start_s: float
    end_s: float


def phases_of(move: MoveReport) -> list[Phase]:
    """The phases of `move` in time; empty ones are left out."""
    half = move.duration_s / 2
    ramp = half
    if move.profile in _RAMP and move.acceleration > 0:
        ramp = min(half, _RAMP[move.profile] * move.peak_velocity / move.acceleration)
    end_s = move.start_s + move.duration_s
    corners = (move.start_s, move.start_s + ramp, end_s - ramp, end_s)
    found = map(Phase, PHASES, corners[:-1], corners[1:])
    # The cruise of a triangle is no longer than rounding.
    return [p for p in found if p.end_s - p.start_s > 1e-9 * max(move.duration_s, 1e-9)]


# Colours that remain distinct for the colour-blind (Okabe and Ito 2008), and dashes for print.
BLUE, VERMILLION, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "black"
_AXIS_STYLES: dict[int, dict[str, Any]] = {
    1: {"color": BLUE, "linestyle": "-"},
    2: {"color": VERMILLION, "linestyle": "--"},
}
_PHASE_STYLES: dict[str, dict[str, Any]] = {
    ACCELERATE: {"facecolor": "0.87"},
    CRUISE: {"facecolor": "0.95"},
    DECELERATE: {"facecolor": "0.95", "hatch": "////", "edgecolor": "0.8", "linewidth": 0.0},
}
_MOST_MARKS = 40
# Statements that are named where moves are too many.
_MOST_NAMED = 4
# Samples that are drawn as dots, as what lies between a few of them is not known.
_MOST_DOTS = 150
# Intervals of an area; the beginning of a long run is drawn in detail for this many moves, and
# for this long after the last of them.
_MOST_DRAWN = 1000
_MOST_DETAILED = 4
_SETTLING_S = 0.2
_MARGIN = "stall margin (%)"
# Height of a legend, in heights of the curves below it.
_LEGEND_SHARE = 0.25


@dataclass(frozen=True)
class _Trace:
    """A curve of one axis (or of none): its column, the factor to the panel's unit, its name."""

    column: str
    scale: float
    axis: int | None
    label: str
    secondary: bool = False


@library_style()
def draw(
    envelopes: Envelopes, title: str, run: Run | None = None, unit: str | None = None
) -> ShownFigure:
    """Position, speed, lag, stall margin, force, phase currents and temperature over time.

    Lengths are in `unit`, or that of the program's moves, or mm. What no column holds is not
    drawn, nor an axis that never moves. The moves of `run` are shaded by phase and named by
    their lines. Raises ValueError for a `unit` that is no length, and where nothing is to be
    drawn.
    """
    from mopro.recording.shown_figure import ShownFigure

    unit = unit or _unit_of(run)
    if unit not in UNITS or UNITS[unit][0] != "length":
        raise ValueError(f"'{unit[:20]}' is not a unit of length, such as in or mm")
    panels = _panels(envelopes, 1 / float(UNITS[unit][1]), unit)
    moves = run.moves if run else ()
    if all(move.stall_margin is None for move in moves):
        panels.pop(_MARGIN)
    if not panels:
        raise ValueError("the recording holds no readings that could be drawn")
    detailed = envelopes.samples_per_bucket > 1 and not 0 < len(moves) <= _MOST_MARKS
    parts: list[tuple[Envelopes, Sequence[MoveReport], float]]
    parts = [(envelopes, moves, envelopes.end_s)]
    if detailed:
        parts.append(_beginning(envelopes, moves))
    figure = ShownFigure(figsize=(10, 1.2 + 1.7 * len(panels)), layout="constrained")
    grid = figure.subplots(
        len(panels), len(parts), sharex="col", squeeze=False, width_ratios=[3, 2][: len(parts)]
    )
    stalls_s = _stalls_s(run)
    for column, part in zip(grid.T, parts, strict=True):
        _draw_column(column, panels, *part)
        _mark_stalls(column, [t for t in stalls_s if t < part[-1] + _SETTLING_S])
    for panel, name in zip(grid[:, 0], panels, strict=True):
        panel.set_ylabel(name)
    if detailed:
        grid[0, 1].set_title("the beginning", fontsize=9, pad=18)
    figure.suptitle(plain(title) + _remarks(envelopes, moves), fontsize=11)
    return figure


def _beginning(
    envelopes: Envelopes, moves: Sequence[MoveReport]
) -> tuple[Envelopes, Sequence[MoveReport], float]:
    """The first samples, the few moves that end within them, and until when to draw (s)."""
    first = envelopes.beginning()
    within = [m for m in moves if m.start_s + m.duration_s <= first.end_s][:_MOST_DETAILED]
    ends_s = [m.start_s + m.duration_s + _SETTLING_S for m in within]
    return first, within, min([first.end_s, *ends_s[-1:]])


def _draw_column(
    column: Sequence[Axes],
    panels: Mapping[str, list[_Trace]],
    envelopes: Envelopes,
    moves: Sequence[MoveReport],
    end_s: float,
) -> None:
    """Draw all `panels` from the start to `end_s`."""
    for panel, (name, traces) in zip(column, panels.items(), strict=True):
        panel.grid(alpha=0.3)
        if name == _MARGIN:
            _draw_margins(panel, moves)
        for trace in traces:
            _draw_band(panel, envelopes.band(trace.column, trace.scale), trace)
        if len(traces) > 1:
            add_legend(panel, len(traces))
    column[-1].set_xlabel("time (s)")
    column[0].set_xlim(0.0, max(end_s, 1e-9))
    _mark(column, moves, _changes_until(envelopes, end_s), end_s)


def _changes_until(envelopes: Envelopes, end_s: float) -> list[tuple[float, int]]:
    time_s, lines = envelopes.changes()
    before = time_s < end_s
    return list(zip(time_s[before].tolist(), lines[before].tolist(), strict=True))


def _unit_of(run: Run | None) -> str:
    """The unit of length of all moves, or mm."""
    units = {move.unit for move in run.moves} if run else set()
    unit = units.pop() if len(units) == 1 else ""
    return unit if UNITS.get(unit, ("",))[0] == "length" else "mm"


def _panels(envelopes: Envelopes, per_m: float, unit: str) -> dict[str, list[_Trace]]:
    """The traces of each panel, by its label; only of columns with readings."""
    moving = _moving_axes(envelopes)
    single = len(moving) == 1
    panels: dict[str, list[_Trace]] = {
        f"position ({unit})": [],
        f"speed ({unit}/s)": [],
        f"lag ({unit})": [],
        _MARGIN: [],
        "force (N)": [],
        "phase currents (A)": [],
        "temperature (°C)": [_Trace("temperature_C", 1.0, None, "temperature")],
    }
    position, speed, lag, _, force, current, _ = panels.values()
    for n in moving:
        of = "" if single else f" of axis {n}"
        position.append(_Trace(f"position_{n}_m", per_m, n, f"position{of}"))
        position.append(_Trace(f"command_{n}_m", per_m, n, f"command{of}", secondary=True))
        speed.append(_Trace(f"velocity_{n}_m_s", per_m, n, f"speed{of}"))
        lag.append(_Trace(LAG.format(n), per_m, n, f"lag{of}"))
        force.append(_Trace(f"force_{n}_N", 1.0, n, f"force{of}"))
        current.append(_Trace(f"phase_a_{n}_A", 1.0, n, f"phase A{of}"))
        current.append(_Trace(f"phase_b_{n}_A", 1.0, n, f"phase B{of}", secondary=True))
    seen = {name: [t for t in traces if t.column in envelopes] for name, traces in panels.items()}
    return {name: traces for name, traces in seen.items() if traces or name == _MARGIN}


def _moving_axes(envelopes: Envelopes) -> list[int]:
    """The axes that are told to move; all of them if none is."""
    columns = {
        n: c if (c := f"command_{n}_m") in envelopes else f"position_{n}_m" for n in envelopes.axes
    }
    moving = [n for n, c in columns.items() if c in envelopes and envelopes.band(c).reach > 0]
    return moving or list(columns)


def _draw_band(panel: Axes, band: Band, trace: _Trace) -> None:
    """A line, or an area between the extremes where a line would be no more than a stain."""
    style = dict(_AXIS_STYLES.get(trace.axis or 0, {"color": BLACK, "linestyle": "-"}))
    if trace.secondary:
        style |= {"color": GREEN if trace.axis == 1 else BLACK, "linestyle": ":"}
    draw_band(panel, band, trace.label, style)


def draw_band(panel: Axes, band: Band, label: str, style: Mapping[str, Any]) -> None:
    """Draw `band` as a line if it can be followed by eye, else as an area with its outline."""
    if not band.folded and _reversals(band.low) <= _MOST_DRAWN:
        marker = "." if len(band.time_s) <= _MOST_DOTS else None
        panel.plot(band.time_s, band.low, label=label, marker=marker, **{"linewidth": 1.0, **style})
        return
    area = band.coarse(_MOST_DRAWN)
    panel.fill_between(
        area.time_s, area.low, area.high, color=style["color"], alpha=0.2, linewidth=0
    )
    panel.plot(area.time_s, area.high, label=label, **{**style, "linewidth": 0.8})
    panel.plot(area.time_s, area.low, **{**style, "linewidth": 0.8})


def add_legend(panel: Axes, columns: int) -> None:
    """A legend in a row above the curves of `panel`, which makes room for it."""
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + _LEGEND_SHARE * (high - low))
    panel.legend(loc="upper right", fontsize=7, ncols=columns)


def _reversals(values: Floats) -> int:
    """The number of times that `values` turn back."""
    steps = np.diff(values)
    signs = np.sign(steps[np.isfinite(steps) & (steps != 0)])
    return int(np.count_nonzero(np.diff(signs)))


def _draw_margins(panel: Axes, moves: Sequence[MoveReport]) -> None:
    """The least stall margin of each move, over its duration."""
    for axes, group in groupby(sorted(moves, key=lambda m: m.axes), key=lambda m: m.axes):
        known = [m for m in group if m.stall_margin is not None]
        style = _AXIS_STYLES.get(axes[0], _AXIS_STYLES[1])
        panel.hlines(
            [100 * (m.stall_margin or 0.0) for m in known],
            [m.start_s for m in known],
            [m.start_s + m.duration_s for m in known],
            color=style["color"], linewidth=2.0, capstyle="projecting",
        )  # fmt: skip
    panel.set_ylim(0.0, 100.0)


def _stalls_s(run: Run | None) -> list[float]:
    """Times (s) at which axes slipped; the end of the move where nobody saw the moment."""
    if run is None:
        return []
    seen = [stall.time_s for stall in run.stalls if stall.time_s is not None]
    return seen or [m.start_s + m.duration_s for m in run.moves if m.slipped]


def _mark_stalls(column: Sequence[Axes], times_s: Sequence[float]) -> None:
    """A line through all panels at each of the first stalls, named on the last panel."""
    for number, t in enumerate(times_s[:_MOST_MARKS]):
        for panel in column:
            panel.axvline(
                t, color=VERMILLION, linestyle="-.", linewidth=1.2,
                label="stall" if panel is column[-1] and not number else None,
            )  # fmt: skip
    if times_s:
        add_legend(column[-1], 2)


def _mark(
    column: Sequence[Axes],
    moves: Sequence[MoveReport],
    changes: Sequence[tuple[float, int]],
    end_s: float,
) -> None:
    """Shade the phases of the moves, and mark the source lines, unless there are too many."""
    mark_changes(column[0], changes)
    if len(moves) > _MOST_MARKS:
        return
    handles = {}
    for phase in (phase for move in moves for phase in phases_of(move)):
        for panel in column:
            handles[phase.name] = panel.axvspan(
                phase.start_s, min(phase.end_s, end_s), zorder=0, **_PHASE_STYLES[phase.name]
            )
    if handles:
        column[0].figure.legend(
            handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize=8
        )


def _remarks(envelopes: Envelopes, moves: Sequence[MoveReport]) -> str:
    """Further lines of the title: how the figure leaves things out; empty if it does not."""
    remarks = []
    if len(moves) > _MOST_MARKS:
        lines = [f"line {own.worst.line} × {own.count}" for own in folded(moves)]
        more = ", ..." if len(lines) > _MOST_NAMED else ""
        named = f"{', '.join(lines[:_MOST_NAMED])}{more}"
        remarks.append(f"{len(moves)} moves, too many to mark ({named})")
    if envelopes.samples_per_bucket > 1:
        each = envelopes.samples_per_bucket
        remarks.append(f"areas reach from the least to the greatest of each {each} samples")
    return "".join(f"\n{remark}" for remark in remarks)


def mark_lines(panel: Axes, time_s: Sequence[float], lines: Sequence[int]) -> None:
    """Mark each change of the source line at the top of `panel`, unless there are too many."""
    mark_changes(panel, _changes(time_s, lines))


def _changes(time_s: Sequence[float], lines: Iterable[int]) -> Iterator[tuple[float, int]]:
    start = 0
    for line, group in groupby(lines):
        yield float(time_s[start]), line
        start += sum(1 for _ in group)


def mark_changes(panel: Axes, changes: Iterable[tuple[float, int]]) -> None:
    """Mark the times at which source lines begin, unless there are too many."""
    marks = list(changes)
    if len(marks) > _MOST_MARKS:
        return
    for t, line in marks:
        panel.axvline(t, color="0.6", linewidth=0.8, zorder=0.5)
        panel.annotate(
            f"line {line}", (t, 1.01), xycoords=("data", "axes fraction"), fontsize=7, rotation=30
        )
