"""Envelopes: the least and the greatest value of each column in short intervals of time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]

# Intervals kept at most, each of one sample in runs of up to ten seconds at 2 kHz.
MOST_INTERVALS = 20_000
# Changes of the source line that are kept; more of them cannot be marked legibly.
_MOST_CHANGES = 200


@dataclass(frozen=True)
class Band:
    """Least and greatest value in each interval, and the middle of its times (s).

    The two are equal where each interval is one sample, and NaN where it has no reading.
    """

    time_s: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, time_s: Floats, values: Floats) -> Band:
        """The samples of one series as they are."""
        return cls(time_s, values, values)

    @property
    def folded(self) -> bool:
        """True if an interval holds different values."""
        return not np.array_equal(self.low, self.high, equal_nan=True)

    @property
    def empty(self) -> bool:
        """True if no sample is a number."""
        return not np.isfinite(self.low).any()

    def coarse(self, most: int) -> Band:
        """This band in at most `most` intervals."""
        width = -(-len(self.time_s) // most)
        if width <= 1:
            return self
        starts = np.arange(0, len(self.time_s), width)
        first, last = self.time_s[starts], self.time_s[np.append(starts[1:], len(self.time_s)) - 1]
        low, high = np.fmin.reduceat(self.low, starts), np.fmax.reduceat(self.high, starts)
        return Band((first + last) / 2, low, high)

    @property
    def reach(self) -> float:
        """Greatest value minus least; 0 if there is none."""
        return 0.0 if self.empty else float(np.nanmax(self.high) - np.nanmin(self.low))


class Envelopes:
    """A sink that keeps the extremes of a recording of any length in constant memory.

    All samples of an interval count, so no peak is lost. Up to `most` samples are kept as
    they are; beyond, the intervals double. `lag_n_m` (command minus position of axis n) is
    kept as a further column. `changes` are the times and numbers of the first source lines,
    `beginning` the first `most` samples as they are.
    """

    def __init__(self, most: int = MOST_INTERVALS) -> None:
        self._most = most
        self._samples = 0
        self._low: dict[str, Floats] = {}
        self._high: dict[str, Floats] = {}
        self.samples_per_interval = 1
        self.changes: list[tuple[float, int]] = []
        self._beginning: list[Columns] = []

    @classmethod
    def of(cls, columns: Columns, most: int = MOST_INTERVALS) -> Envelopes:
        """The envelopes of a recording in memory."""
        envelopes = cls(most)
        envelopes.write(columns)
        return envelopes

    def write(self, columns: Columns) -> None:
        """Add a chunk; each has the same columns."""
        count = len(columns["time_s"])
        if not count:
            return
        self._note_changes(columns)
        if self._samples < self._most:
            rest = slice(self._most - self._samples)
            self._beginning.append({name: v[rest] for name, v in columns.items()})
        while -(-(self._samples + count) // self.samples_per_interval) > self._most:
            self._widen()
        width = self.samples_per_interval
        place = (self._samples + np.arange(count)) // width
        starts = np.flatnonzero(np.diff(place, prepend=-1))
        joins = self._samples % width != 0
        for name, values in _with_lags(columns).items():
            own = np.asarray(values, dtype=np.float64)
            self._low[name] = _joined(self._low.get(name), own, starts, joins, np.fmin)
            self._high[name] = _joined(self._high.get(name), own, starts, joins, np.fmax)
        self._samples += count

    def __contains__(self, column: str) -> bool:
        return column in self._low and not self.band(column).empty

    def band(self, column: str, scale: float = 1.0) -> Band:
        """The envelope of `column`, its values times `scale` (positive)."""
        time_s = (self._low["time_s"] + self._high["time_s"]) / 2
        return Band(time_s, self._low[column] * scale, self._high[column] * scale)

    def beginning(self) -> Envelopes:
        """The envelopes of the first samples, each as it is."""
        first = Envelopes(self._most)
        for chunk in self._beginning:
            first.write(chunk)
        return first

    @property
    def axes(self) -> list[int]:
        """The axes with a command or a position, ascending."""
        named = (c.split("_") for c in self._low if c.startswith(("command_", "position_")))
        return sorted({int(parts[1]) for parts in named})

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return float(self._high["time_s"][-1])

    def _note_changes(self, columns: Columns) -> None:
        if "line" not in columns or len(self.changes) > _MOST_CHANGES:
            return
        lines = np.asarray(columns["line"])
        last = self.changes[-1][1] if self.changes else None
        rows = np.flatnonzero(np.diff(lines, prepend=lines[0])).tolist()
        rows = rows if lines[0] == last else [0, *rows]
        time_s = columns["time_s"]
        self.changes += [(float(time_s[i]), int(lines[i])) for i in rows[: _MOST_CHANGES + 1]]

    def _widen(self) -> None:
        """Join intervals in pairs."""
        self.samples_per_interval *= 2
        for kept, pick in ((self._low, np.fmin), (self._high, np.fmax)):
            for name, values in kept.items():
                kept[name] = pick.reduceat(values, np.arange(0, len(values), 2))


def _with_lags(columns: Columns) -> Columns:
    axes = [name.split("_")[1] for name in columns if name.startswith("position_")]
    lags = {
        f"lag_{n}_m": columns[f"command_{n}_m"] - columns[f"position_{n}_m"]
        for n in axes
        if f"command_{n}_m" in columns
    }
    return {**columns, **lags}


def _joined(
    kept: Floats | None, values: Floats, starts: NDArray[np.intp], joins: bool, pick: np.ufunc
) -> Floats:
    """`kept` intervals and those of `values` that begin at `starts`; `joins`: the first one does
    not begin there, but goes on with the last kept one."""
    reduced: Floats = pick.reduceat(values, starts)
    if kept is None:
        return reduced
    if joins:
        kept[-1] = pick(kept[-1], reduced[0])
        reduced = reduced[1:]
    return np.concatenate([kept, reduced])
