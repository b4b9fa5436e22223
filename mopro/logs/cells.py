"""Cells that are no plain readings: overload, values stated as missing, absurd ones, lists."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mopro.errors import DataError
from mopro.logs.cell_kinds import as_number, is_list
from mopro.logs.column_names import heading
from mopro.logs.layout import MOST_COLUMNS
from mopro.logs.log import Decision, Floats, Table

# -- numbers that are none --------------------------------------------------------------------
# Numbers in cells that are no readings: overload, values stated as missing, absurd ones.


# Instruments that speak SCPI write 9.9E37 for an overload, 9.91E37 for no number.
OVERLOAD = 9e37
# A few readings of one value this many ranges of the others away are absurd.
_FAR = 20.0
_MOST_SHARE = 0.05
# Values that stand for no reading, and occur once.
_CODES = frozenset(
    sign * code
    for code in (999.0, 9999.0, 99999.0, 32767.0, 32768.0, 65535.0, 2147483647.0, 4294967295.0)
    for sign in (1, -1)
)


def without_overload(table: Table) -> Table:
    """The table without readings of 9e37 and more, with their number as decisions."""
    columns, decisions = dict(table.columns), list(table.decisions)
    for name, values in _numbers(table, ()):
        if not (_most(values) >= OVERLOAD):
            continue
        beyond = np.abs(values) >= OVERLOAD
        columns[name] = np.where(beyond, np.nan, values)
        taken = f"{np.count_nonzero(beyond)} readings of 9e37 or more are missing"
        reason = f"an overload, first at row {int(np.argmax(beyond)) + 1} of the data"
        decisions.append(Decision(f"column {name}", taken, reason))
    return replace(table, columns=columns, decisions=tuple(decisions))


def without_missing(table: Table, stamps: Collection[str], words: Sequence[str]) -> Table:
    """The table without the values that the caller states as missing; absurd ones are told.

    Columns that are `stamps` stay as they are.
    """
    stated = [number for word in words if (number := as_number(word)) is not None]
    columns, decisions = dict(table.columns), list(table.decisions)
    for name, _ in _numbers(table, stamps):
        for number in stated:
            gone = columns[name] == number
            if count := int(np.count_nonzero(gone)):
                columns[name] = np.where(gone, np.nan, columns[name])
                taken = f"{count} readings of {number:g} are missing"
                decisions.append(Decision(f"column {name}", taken, "as stated on the command line"))
        decisions += [_absurd(name, *found) for found in _absurd_values(columns[name])]
    return replace(table, columns=columns, decisions=tuple(decisions))


def _numbers(table: Table, stamps: Collection[str]) -> Iterator[tuple[str, Floats]]:
    for name, values in table.columns.items():
        if isinstance(values, np.ndarray) and values.dtype.kind == "f" and name not in stamps:
            yield name, values


def _most(values: Floats) -> float:
    """The largest size of the numbers; 0 if there are none."""
    if not len(values):
        return 0.0
    return float(np.fmax(np.fmax.reduce(values), -np.fmin.reduce(values)))


def _absurd_values(values: Floats) -> Iterator[tuple[float, int, int]]:
    """Values far from all others, how often each occurs, and its first row; outermost first."""
    for outermost in (np.fmax, np.fmin):
        reduce: Any = outermost.reduce
        value = float(reduce(values)) if len(values) else np.nan
        if np.isnan(value):
            return
        same = values == value
        count = int(np.count_nonzero(same))
        if count > _MOST_SHARE * len(values) or (count < 2 and value not in _CODES):
            continue
        others = values[~same]
        low, high = float(np.fmin.reduce(others)), float(np.fmax.reduce(others))
        if 0 < high - low < max(value - high, low - value) / _FAR:
            yield value, count, int(np.argmax(same))


def _absurd(name: str, value: float, count: int, row: int) -> Decision:
    subject = f"column {name}"
    taken = f"{count} readings are {value:g}, far from all others, and taken as they are"
    reason = f"first at row {row + 1} of the data; --missing {value:g} leaves them out"
    return Decision(subject, taken, reason, check=True)


# -- lists of numbers -------------------------------------------------------------------------
# Columns whose cells are lists of numbers, as columns of numbers: `q[0]`, `q[1]`.

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
