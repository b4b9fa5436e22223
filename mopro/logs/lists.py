"""Columns whose cells are lists of numbers, as columns of numbers: `q[0]`, `q[1]`."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from mopro.errors import DataError
from mopro.logs.layout import MOST_COLUMNS
from mopro.logs.log import Decision
from mopro.logs.names import heading
from mopro.logs.table import Table
from mopro.logs.written import is_list

_SAMPLE = 50
_SEPARATOR = r"[,;\s]+"
_EDGE = re.compile(r"^\s*(?:array\()?[\[(]\s*|[,;\s]*[\])]\)?\s*$").pattern


def with_lists(table: Table) -> Table:
    """The table, with a column for each place in the lists of one length that its cells hold."""
    columns: dict[str, Any] = {}
    decisions = list(table.decisions)
    for name, values in table.columns.items():
        lists = None if isinstance(values, np.ndarray) else _lists_in(values)
        if lists is None:
            columns[name] = values
            continue
        width, numbers = _numbers_of(lists)
        if numbers is None:
            reason = "its cells are lists of different lengths, or of more than numbers"
            decisions.append(Decision(f"column {name}", "left out", reason, check=True))
            continue
        found = heading(name, table.units.get(name))
        unit = f" [{found.unit}]" if found.unit else ""
        columns |= {f"{found.name}[{nth}]{unit}": numbers[:, nth] for nth in range(width)}
        if len(columns) > MOST_COLUMNS:
            message = f"{table.source.name}: more than {MOST_COLUMNS} columns in lists"
            raise DataError(message, "too-long")
        taken = f"{width} columns {found.name}[0] to {found.name}[{width - 1}]"
        decisions.append(Decision(f"column {name}", taken, "its cells are lists of numbers"))
    return replace(table, columns=columns or table.columns, decisions=tuple(decisions))


def _lists_in(values: Any) -> Any:
    """An Arrow array of lists; None if the cells are none."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_list(values.type) or pa.types.is_fixed_size_list(values.type):
        return values
    filled = [w for w in values.slice(0, _SAMPLE).to_pylist() if w]
    if not filled or not all(map(is_list, filled)):
        return None
    inner = pc.replace_substring_regex(values, _EDGE, "")
    return pc.split_pattern_regex(inner, _SEPARATOR)


def _numbers_of(lists: Any) -> tuple[int, Any]:
    """Length of the lists and their numbers (rows, length); None where they are none."""
    import pyarrow as pa
    import pyarrow.compute as pc

    known = pc.drop_null(lists)
    lengths = pc.unique(pc.list_value_length(known)).to_pylist()
    if len(lengths) != 1 or not lengths[0]:
        return 0, None
    width = int(lengths[0])
    try:
        flat = pc.cast(pc.list_flatten(known), pa.float64()).to_numpy(zero_copy_only=False)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        return width, None
    numbers = np.full((len(lists), width), np.nan)
    rows = np.flatnonzero(pc.is_valid(lists).to_numpy(zero_copy_only=False))
    numbers[rows] = np.where(np.isinf(flat), np.nan, flat).reshape(-1, width)
    return width, numbers
