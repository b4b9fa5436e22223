"""Pictures of recordings, and the HTML report."""

from mopro.plot.figure import figure_bytes
from mopro.plot.picture import plot_recording
from mopro.plot.report import report_page

__all__ = ["figure_bytes", "plot_recording", "report_page"]
