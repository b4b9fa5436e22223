"""Logs of machines as they are on disk: read, with every decision on the way as a note.

`read_log` takes CSV of any layout, Parquet, NPZ, HDF5 and MCAP and gives a `Log`: columns of
numbers with names, units and one clock each. Nothing that stands in a file is executed.
"""

from mopro.logs.log import Column, Decision, Log, Rows
from mopro.logs.open import Asked, read_log

__all__ = ["Asked", "Column", "Decision", "Log", "Rows", "read_log"]
