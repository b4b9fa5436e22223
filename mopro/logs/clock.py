"""Clocks of a log: which columns are times, of which unit, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.log import Decision
from mopro.logs.order import Habits, order_of
from mopro.logs.stamps import (
    PER_S,
    UNSURE,
    epoch_unit,
    seconds_of_numbers,
    seconds_of_words,
)
from mopro.logs.table import Table
from mopro.logs.timed import Stamp, TimeColumns

Floats = NDArray[np.float64]

# Rows beside a jump of the clock whose changes are usual ones, and how much more is a jump.
_BESIDE = 50
_LEAP = 3.0


@dataclass(frozen=True)
class Clock:
    """A clock: seconds of each row of the file from the first stamp (NaN where there is none).

    `starts` are the rows with which further recordings begin, `strays` those whose time is out of
    place, `origin` is the first stamp in s.
    """

    stamp: Stamp
    time_s: Floats
    origin: float
    decisions: tuple[Decision, ...]
    starts: tuple[int, ...] = ()
    strays: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        return self.stamp.name


# -- their times --------------------------------------------------------------------------


def clock_of(table: Table, stamp: Stamp, unit: str | None = None) -> Clock:
    """The clock of a stamp, whose numbers are in `unit` if the caller knows it.

    Raises stamps.NoStamp for a cell that is no time, order.NoClock for times that are no clock.
    """
    values = table.columns[stamp.name]
    subject = f"column {stamp.name}"
    unit_s, worded = 1.0, not isinstance(values, np.ndarray)
    if worded:
        text, together = words_of_stamp(table, stamp)
        elapsed, origin, how = seconds_of_words(text)
        check = how.endswith(UNSURE)
        decisions = [Decision(subject, f"times ({how})", f"the cells say so{together}", check)]
    else:
        stated = TimeColumns(table).heading(stamp.name)
        taken, reason, check = _unit(values, unit, stated.unit, stated.reason)
        elapsed, origin = seconds_of_numbers(values, taken)
        unit_s = 1 / PER_S[taken]
        decisions = [Decision(subject, f"times in {taken}", reason, check)]
    if stamp.finer is not None:
        part = TimeColumns(table).heading(stamp.finer).unit or "ms"
        parts = np.asarray(table.columns[stamp.finer], float) / PER_S[part]
        elapsed = elapsed + parts
        first = float(elapsed[~np.isnan(elapsed)][0]) if (~np.isnan(elapsed)).any() else 0.0
        elapsed, origin = elapsed - first, origin + first
        taken = f"{part} of the seconds in {stamp.name}"
        decisions.append(Decision(f"column {stamp.finer}", taken, "two columns are one stamp"))
    habits = Habits(stamp.name, unit_s, worded, origin)
    order = order_of(elapsed, habits, _readings_go_on(table, stamp))
    return Clock(
        stamp, order.time_s, origin, (*decisions, *order.decisions), tuple(order.starts),
        tuple(order.strays),
    )  # fmt: skip


def words_of_stamp(table: Table, stamp: Stamp) -> tuple[Any, str]:
    """The words of a stamp, behind those of its date if another column has them."""
    import pyarrow as pa
    import pyarrow.compute as pc

    words = table.columns[stamp.name]
    if stamp.date is None:
        return words, ""
    dates = table.columns[stamp.date]
    if isinstance(dates, np.ndarray):
        numbers = pa.array(dates.astype(float), from_pandas=True)
        digits = pc.cast(pc.cast(numbers, pa.int64()), pa.string())
        dates = pc.replace_substring_regex(digits, r"^(\d{4})(\d\d)(\d\d)$", r"\1-\2-\3")
    dates, words = map(pc.utf8_trim_whitespace, (dates, words))
    return pc.binary_join_element_wise(dates, words, " "), f", with the date in {stamp.date}"


def _readings_go_on(table: Table, stamp: Stamp) -> Any:
    columns = [
        values
        for name, values in table.columns.items()
        if name not in stamp.parts and isinstance(values, np.ndarray) and values.dtype.kind == "f"
    ]

    def goes_on(before: int, after: int) -> bool:
        return all(_is_small(values, before, after) for values in columns)

    return goes_on


def _is_small(values: Floats, before: int, after: int) -> bool:
    """True if a column changes from one row to another one no more than beside them."""
    near = [values[max(before - _BESIDE, 0) : before + 1], values[after : after + _BESIDE]]
    changes = [np.abs(np.diff(part[~np.isnan(part)])) for part in near]
    usual = max((float(c.max()) for c in changes if len(c)), default=0.0)
    leap = abs(float(values[after] - values[before]))
    return bool(np.isnan(leap)) or leap <= _LEAP * usual


def _unit(
    values: NDArray[Any], given: str | None, stated: str | None, reason: str
) -> tuple[str, str, bool]:
    """Unit of a column of times, why, and true if somebody should confirm it."""
    if given is not None:
        return given, "as stated on the command line", False
    if stated in PER_S:
        return str(stated), reason, False
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if len(known) and (epoch := epoch_unit(float(known[0]))):
        return epoch, f"{float(known[0]):.10g} is a date of this century in {epoch}", False
    step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
    return "s", f"no unit is stated; then {step:.6g} s lie between rows", True
