"""Times of a log: the sampling of a clock, and which columns are times.

Sampling: its usual interval, whether it is regular, and its gaps.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.column_names import (
    Heading,
    heading,
    is_command,
    is_time,
    quantity_of,
    unit_of,
    words_of,
)
from mopro.logs.log import Floats, Table
from mopro.logs.stamps import PER_S, epoch_unit, form_of_words

# An interval of this many usual ones is a gap, a last one of this share too short to be a row.
GAP = 5.0
# A clock is regular if so many of its intervals but gaps are within this share of the usual one.
_REGULAR, _MOST = 0.02, 0.9


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
    wide = steps >= GAP * usual
    even = np.count_nonzero(np.abs(steps - usual) < _REGULAR * usual)
    regular = bool(even >= _MOST * (len(steps) - np.count_nonzero(wide)))
    gaps = np.flatnonzero(wide) if regular else np.empty(0, int)
    return Spacing(usual, regular, tuple(int(i) for i in gaps))


# -- columns of times -------------------------------------------------------------------------
# Which columns of a log are times: the cells decide, and of several columns the headings.

# Share of stamps that may go backwards: beyond it the column is no clock.
_MOST_BACKWARD = 0.05
_FINER = ("ms", "us", "ns")
_DATE_NUMBERS = (19_700_101, 20_991_231)
# Behind the name of a second column of times, which has the unit before it.
_REPEATED = re.compile(r"(?<=.) \(\d+\)$")
# Numbers that are looked at before all are.
_FIRST = 50


@dataclass(frozen=True)
class Stamp:
    """The columns that make a time together: a date, a time, and a part of its seconds, as named.

    The time is `name`; the others are None where the log has none.
    """

    name: str
    date: str | None = None
    finer: str | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        return tuple(p for p in (self.date, self.name, self.finer) if p is not None)


def stamps_in(table: Table, asked: str | None = None) -> list[Stamp]:
    """The stamps of the log in the order of the file; only that in column `asked` if one is named.

    The cells decide which columns are times; of several, those whose headings say so.
    """
    columns = TimeColumns(table)
    if asked is not None:
        return [columns.complete(asked)]
    found = columns.worded() + columns.numbered(named=True)
    named = [stamp for stamp in found if any(map(columns.says_time, stamp.parts))]
    chosen = named or found or columns.numbered(named=False)
    order = list(table.columns)
    stamps = sorted((columns.complete(s.name) for s in chosen), key=lambda s: order.index(s.name))
    finer = {s.finer for s in stamps}
    return [s for s in stamps if s.name not in finer]


class TimeColumns:
    """The columns of a table, asked which of them are times."""

    def __init__(self, table: Table) -> None:
        self._table = table
        forms = {
            name: form
            for name, values in table.columns.items()
            if not isinstance(values, np.ndarray) and (form := form_of_words(values)) is not None
        }
        self._forms = forms
        self._dates = [n for n, f in forms.items() if not f.timed]
        self._of_day = [n for n, f in forms.items() if f.timed and not f.dated]
        self._dates += [n for n in table.columns if n not in forms and self._is_date_number(n)]

    def heading(self, name: str) -> Heading:
        """The heading; its unit is also the last word of a name such as `stamp.nanosec`."""
        found = heading(_REPEATED.sub("", name), self._table.units.get(name))
        last = (words_of(name) or [""])[-1]
        unit = unit_of(last)
        if found.unit is None and unit in PER_S and len(last) > 1 and last != "min":
            return replace(found, unit=unit, reason=f"the heading ends in {last}")
        return found

    def worded(self) -> list[Stamp]:
        """Columns of dates with times, or of times of day; of dates if there is nothing finer."""
        names = [n for n, form in self._forms.items() if form.timed]
        return [Stamp(name) for name in names or [n for n in self._dates if n in self._forms]]

    def numbered(self, named: bool) -> list[Stamp]:
        """Columns of numbers that ascend: those named as times, else what can be nothing else."""
        every = [n for n in self._table.columns if n not in self._dates]
        if named:
            return [Stamp(n) for n in every if self.says_time(n) and self._ascends(n)]
        ascending = [n for n in every if self._ascends(n)]
        stated = [n for n in ascending if self.heading(n).unit in PER_S]
        dated = [n for n in ascending if epoch_unit(float(self._known(n)[0])) is not None]
        first = [n for n in list(self._table.columns)[:1] if n in ascending and self._is_even(n)]
        return [Stamp(n) for n in (stated or dated or first)[:1]]

    def complete(self, name: str) -> Stamp:
        """The stamp whose time is in column `name`, with its date and the part of its seconds."""
        date = None
        if name in self._of_day and self._dates:
            nth = self._of_day.index(name)
            date = self._dates[min(nth, len(self._dates) - 1)]
        return Stamp(name, date, self._finer(name))

    def says_time(self, name: str) -> bool:
        """True if the heading says that the column holds times."""
        found = self.heading(name)
        if found.unit is None:
            return is_time(found.name)
        last = (words_of(found.name) or [""])[-1]
        return found.unit in PER_S and (is_time(found.name) or unit_of(last) == found.unit)

    def _numbers(self, name: str) -> NDArray[Any] | None:
        values = self._table.columns[name]
        return values if isinstance(values, np.ndarray) else None

    def _words(self, name: str) -> Any:
        return self._table.columns[name]

    def _known(self, name: str) -> NDArray[Any]:
        values = self._table.columns[name]
        blank = np.isnan(values) if values.dtype.kind == "f" else np.zeros(0, bool)
        known: NDArray[Any] = values[~blank] if blank.any() else values
        return known

    def _ascends(self, name: str) -> bool:
        """True for numbers that ascend, or descend where the newest row is the first."""
        if self._numbers(name) is None:
            return False
        known = self._known(name)
        if len(known) < 2 or known.min() == known.max():
            return False
        steps = np.diff(known)
        return bool(min(np.mean(steps < 0), np.mean(steps > 0)) <= _MOST_BACKWARD)

    def _is_even(self, name: str) -> bool:
        """True for a first column that ascends as a clock does and is named as nothing else."""
        found = self.heading(name)
        if found.unit is not None or is_command(name) or quantity_of(name, None) is not None:
            return False
        steps = np.diff(self._known(name))
        counts = bool(np.all(steps == 1))
        return bool(np.all(steps > 0)) and not counts and spacing_of(self._known(name)).regular

    def _is_date_number(self, name: str) -> bool:
        """True for numbers such as 20261122: beside a time of day, or by the heading."""
        values = self._numbers(name)
        if values is None or not (self._of_day or is_time(self.heading(name).name)):
            return False
        known = self._known(name)
        low, high = _DATE_NUMBERS
        if not len(known) or known.min() < low or known.max() > high or not _are_whole(known):
            return False
        months, days = known // 100 % 100, known % 100
        return bool(
            months.min() >= 1 and months.max() <= 12 and days.min() >= 1 and days.max() <= 31
        )

    def _finer(self, name: str) -> str | None:
        """The column of ms, us or ns that belongs to whole seconds in column `name`."""
        if not self._is_whole(name):
            return None
        for other in self._table.columns:
            unit = self.heading(other).unit
            values = self._numbers(other)
            if other == name or unit not in _FINER or values is None:
                continue
            known = self._known(other)
            if not _are_whole(known) or np.ptp(known) == 0:
                continue
            if known.min() >= 0 and known.max() < PER_S[unit]:
                return other
        return None

    def _is_whole(self, name: str) -> bool:
        values = self._numbers(name)
        if values is None:
            form = self._forms.get(name)
            return form is not None and form.timed and self._has_no_fractions(name)
        stated = self.heading(name).unit or "s"
        return stated == "s" and _are_whole(self._known(name))

    def _has_no_fractions(self, name: str) -> bool:
        words: list[str | None] = self._words(name).slice(0, 100).to_pylist()
        return not any(
            "." in w.rsplit(":", 1)[-1] or "," in w.rsplit(":", 1)[-1] for w in words if w
        )


def _are_whole(numbers: NDArray[Any]) -> bool:
    """True for whole numbers; few of others are looked at."""
    parts = (numbers[:_FIRST], numbers)
    return bool(len(numbers)) and all(bool(np.all(p == np.floor(p))) for p in parts)
