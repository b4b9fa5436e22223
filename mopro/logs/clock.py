"""Clocks of a log: which columns are times, of which unit, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.log import Decision
from mopro.logs.names import heading, is_time
from mopro.logs.stamps import PER_S, epoch_unit, seconds_of_numbers, seconds_of_words
from mopro.logs.table import Table

Floats = NDArray[np.float64]

# An interval of this many usual ones is a gap, a last one of this share too short to be a row.
GAP = 5.0
# Relative spread of the intervals below which a clock is regular.
_REGULAR = 0.02
# Share of stamps that may go backwards: beyond it the column is no clock.
_MOST_BACKWARD = 0.05


@dataclass(frozen=True)
class Clock:
    """A column of times: seconds from its first stamp, the first stamp, rows in order.

    `order` are the rows that are kept, by time: rows without a stamp and, of several with one
    stamp, all but the last are left out.
    """

    name: str
    elapsed: Floats
    origin: float
    order: NDArray[np.intp]
    decisions: tuple[Decision, ...]


@dataclass(frozen=True)
class Spacing:
    """Sampling of a clock: usual interval, gaps (row before each), true if it is regular."""

    interval_s: float
    regular: bool
    gaps: tuple[int, ...]

    @property
    def rate_hz(self) -> float:
        return 1 / self.interval_s


def spacing_of(time_s: Floats) -> Spacing:
    """The sampling of ascending times (n >= 2)."""
    steps = np.diff(time_s)
    usual = float(np.median(steps))
    within = steps[steps < GAP * usual]
    regular = bool(np.quantile(np.abs(within / usual - 1), 0.9) < _REGULAR)
    gaps = np.flatnonzero(steps >= GAP * usual) if regular else np.empty(0, int)
    return Spacing(usual, regular, tuple(int(i) for i in gaps))


def clock_columns(table: Table) -> list[str]:
    """The columns that hold times: by name, or words that are dates; in the order of the file."""
    return [name for name, values in table.columns.items() if _may_be_clock(table, name, values)]


def _may_be_clock(table: Table, name: str, values: Any) -> bool:
    found = heading(name, table.units.get(name))
    if not isinstance(values, np.ndarray):
        first = next((str(w) for w in values.slice(0, 1000).to_pylist() if w), "")
        return is_time(found.name) and ":" in first
    if not is_time(found.name) or (found.unit is not None and found.unit not in PER_S):
        return False
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if len(known) < 2 or known[0] == known[-1]:
        return False
    return bool(np.mean(np.diff(known) < 0) <= _MOST_BACKWARD)


def clock_of(table: Table, name: str, unit: str | None = None) -> Clock:
    """The clock in column `name`, in `unit` if the caller knows it.

    Raises stamps.NoStamp for a cell that is no time.
    """
    values = table.columns[name]
    if isinstance(values, np.ndarray):
        stated = heading(name, table.units.get(name))
        taken, reason, check = _unit(values, unit, stated.unit, stated.reason)
        elapsed, origin = seconds_of_numbers(values, taken)
        decisions = [Decision(f"column {name}", f"times in {taken}", reason, check)]
    else:
        elapsed, origin, how = seconds_of_words(values)
        decisions = [Decision(f"column {name}", f"times ({how})", "the cells say so")]
    order, faults = _ordered(name, elapsed)
    return Clock(name, elapsed, origin, order, (*decisions, *faults))


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


def _ordered(name: str, elapsed: Floats) -> tuple[NDArray[np.intp], list[Decision]]:
    """The rows to keep, in order of time, and what was wrong."""
    kept = np.flatnonzero(~np.isnan(elapsed))
    decisions = []
    subject = f"column {name}"
    if lost := len(elapsed) - len(kept):
        decisions.append(Decision(subject, f"{lost} rows without a time are left out", "empty"))
    steps = np.diff(elapsed[kept])
    backward = np.flatnonzero(steps < 0)
    if len(backward):
        where = f"first in row {int(kept[backward[0] + 1]) + 1} of the data"
        taken = f"rows sorted by time: the clock runs backwards {len(backward)} times"
        decisions.append(Decision(subject, taken, where, check=True))
        kept = kept[np.argsort(elapsed[kept], kind="stable")]
        steps = np.diff(elapsed[kept])
    double = np.flatnonzero(steps == 0)
    if len(double):
        where = f"first in row {int(kept[double[0] + 1]) + 1} of the data"
        taken = f"{len(double)} rows left out whose time is that of the next row"
        decisions.append(Decision(subject, taken, where))
        kept = np.delete(kept, double)
    return kept, decisions
