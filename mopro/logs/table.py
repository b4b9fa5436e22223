"""Cells of a log as columns of numbers or words, whatever the file's format."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.log import Decision
from mopro.logs.place import LogSource

MOST_ROWS = 20_000_000


@dataclass(frozen=True)
class Table:
    """Columns of one length: floats, integers (of stamps) or Arrow arrays of words, in order.

    `units` holds what the file states apart from the headings, `left_out` the number of rows of the
    file that are not in the columns, by reason.
    """

    source: LogSource
    columns: dict[str, NDArray[Any] | Any]
    units: dict[str, str]
    decisions: tuple[Decision, ...]
    header_line: int = 1
    first_line: int = 1
    lines: NDArray[np.int64] | None = None
    delimiter: str = ","
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())))
