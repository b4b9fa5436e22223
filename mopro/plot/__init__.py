"""Figures as files."""

from mopro.recording.shown_figure import figure_bytes

__all__ = ["figure_bytes"]
