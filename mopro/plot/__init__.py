"""HTML pages and figures."""

from mopro.plot.figure import figure_bytes
from mopro.plot.report import report_page

__all__ = ["figure_bytes", "report_page"]
