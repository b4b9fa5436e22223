"""Pages and figures that people look at."""

from mopro.plot.report import report_page

__all__ = ["report_page"]
