"""Acceleration limits as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mopro.emulator.limits import PROFILES, Limit
from mopro.recording.style import library_style
from mopro.text import plain

if TYPE_CHECKING:
    from mopro.recording.shown_figure import ShownFigure


@library_style()
def plot_limits(limits: list[Limit], title: str) -> ShownFigure:
    """Largest acceleration, and the duration of the timed move, against peak velocity."""
    from mopro.recording.shown_figure import ShownFigure

    figure = ShownFigure(figsize=(8, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for profile in PROFILES:
        points = [
            (each.velocity, each.acceleration, each.duration_s)
            for each in limits
            if each.profile == profile and each.acceleration is not None
        ]
        if points:
            velocity, acceleration, duration = zip(*points, strict=True)
            upper.plot(velocity, acceleration, marker="o", label=profile)
            lower.plot(velocity, duration, marker="o", label=profile)
    upper.set_ylabel("largest acceleration (in/s²)")
    lower.set_ylabel("duration of the move (s)")
    lower.set_xlabel("peak velocity (in/s)")
    for panel in (upper, lower):
        panel.grid(alpha=0.3)
        panel.legend()
    figure.suptitle(plain(title))
    return figure
