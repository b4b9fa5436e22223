"""Logs whose newest row is the first: their rows, turned round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mopro.logs.clock import words_of_stamp
from mopro.logs.log import Decision, Floats
from mopro.logs.stamps import NoStamp, seconds_of_words
from mopro.logs.table import Table
from mopro.logs.timed import Stamp

# Rows of which the direction is taken, and the share of steps back that makes it.
_SAMPLE = 1000
_MOST = 0.8


def oldest_first(table: Table, stamps: list[Stamp]) -> Table:
    """The table with its rows in the order of time: turned round if its first stamp descends."""
    if not stamps or not _descends(table, stamps[0]):
        return table
    reason = "the newest row is the first: rows are counted from the last one"
    told = Decision(f"column {stamps[0].name}", "read from the end", reason, True, True)
    every = table.first_line + np.arange(table.rows) if table.lines is None else table.lines
    return replace(
        table,
        columns={name: values[::-1] for name, values in table.columns.items()},
        lines=every[::-1],
        decisions=(*table.decisions, told),
    )


def _descends(table: Table, stamp: Stamp) -> bool:
    times = _sampled(table, stamp)
    steps = np.diff(times[~np.isnan(times)])
    steps = steps[steps != 0]
    return len(steps) > 1 and bool(np.mean(steps < 0) > _MOST)


def _sampled(table: Table, stamp: Stamp) -> Floats:
    """Times of the first rows, in any unit."""
    values = table.columns[stamp.name]
    if isinstance(values, np.ndarray):
        own: NDArray[np.float64] = np.asarray(values[:_SAMPLE], float)
        return own
    words, _ = words_of_stamp(table, stamp)
    try:
        return seconds_of_words(words.slice(0, _SAMPLE))[0]
    except NoStamp:
        return np.zeros(0)  # told with its line where all are read
