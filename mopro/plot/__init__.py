"""Figures as files."""

from mopro.plot.figure import figure_bytes

__all__ = ["figure_bytes"]
