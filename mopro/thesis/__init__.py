"""The source's tables, printed beside computed."""

from mopro.thesis.tables import TABLES, Row, table

__all__ = ["TABLES", "Row", "table"]
