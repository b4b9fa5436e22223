"""Pictures of recordings, and the HTML report."""

from mopro.plot.picture import plot_recording
from mopro.plot.report import report_page

__all__ = ["plot_recording", "report_page"]
