"""Envelopes: the least and the greatest value of each channel in short intervals of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Columns = Mapping[str, NDArray[Any]]

# A recording of up to this many samples is kept in full; of a longer one half as many buckets or
# more, each with its least and greatest value.
MOST_BUCKETS = 65_536
# The beginning of a long recording that is kept in full.
HEAD = 32_768
MOST_LINE_CHANGES = 100_000
LAG = "lag_{}_m"


@dataclass(frozen=True)
class Buckets:
    """Least and greatest value of each channel in n buckets of `size` samples.

    `first` and `second` (channels, n) are these two in the order in which they occur. `start`
    and `end` (n,) are the times of a bucket's first and last sample. The last bucket may have
    fewer samples. Where `size` is 1, `first` and `second` are the samples themselves.
    """

    size: int
    start: Floats
    end: Floats
    first: Singles
    second: Singles

    def __len__(self) -> int:
        return len(self.start)

    @staticmethod
    def of(time: Floats, channels: Singles) -> Buckets:
        """One bucket for each sample of `channels` (channels, n)."""
        return Buckets(1, time, time, channels, channels)

    def between(self, begin: int, end: int | None, step: int = 1) -> Buckets:
        """Every `step`-th bucket from `begin` to `end`."""
        part = slice(begin, end, step)
        return Buckets(
            self.size, self.start[part], self.end[part], self.first[:, part], self.second[:, part]
        )

    def halved(self) -> Buckets:
        """Buckets of twice the size; their number must be even."""
        one, other = self.between(0, None, 2), self.between(1, None, 2)
        if self.size == 1:
            first, second = one.first, other.first
        else:
            first, second = _extremes(one, other)
        return Buckets(2 * self.size, one.start, other.end, first, second)


class Envelope:
    """Buckets of a series that arrives in chunks; their size doubles as it grows.

    At most `most` buckets and one that is not full, and at least half as many once they have
    several samples. No sample is left out, so the extremes of the series are those of its
    buckets. NaN counts as no sample.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: list[Buckets] = []
        self._count = 0
        # An odd bucket of each smaller size, which waits for the next to be joined with.
        self._waiting: list[Buckets | None] = []

    def add(self, time: Floats, channels: Singles) -> None:
        """Add a chunk: n ascending times, and the channels (channels, n) at them."""
        part = Buckets.of(time, channels)
        for level in range(len(self._waiting)):
            part = self._joined(level, part)
        self._keep(part)
        while self._count > self._most:
            self._halve()

    @property
    def size(self) -> int:
        """Samples in a bucket."""
        return 1 << len(self._waiting)

    def buckets(self) -> Buckets:
        """The buckets so far; ValueError before the first chunk."""
        rest = [part for part in reversed(self._waiting) if part is not None]
        return together([*self._kept, *([_one(rest)] if rest else [])])

    def _keep(self, part: Buckets) -> None:
        self._kept.append(part)
        self._count += len(part)

    def _halve(self) -> None:
        whole = together(self._kept)
        self._waiting.append(None)
        self._kept, self._count = [], 0
        self._keep(self._joined(len(self._waiting) - 1, whole))

    def _joined(self, level: int, part: Buckets) -> Buckets:
        """Buckets of twice the size; an odd one waits."""
        waiting = self._waiting[level]
        if waiting is not None:
            part = together([waiting, part])
        even = len(part) // 2 * 2
        self._waiting[level] = part.between(even, None) if even < len(part) else None
        return part.between(0, even).halved()


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

    At most `most` buckets, the first `head` samples in full, and the changes of the source
    line. `lag_n_m` (command minus position of axis n) is a further channel.
    """

    def __init__(self, most: int = MOST_BUCKETS, head: int = HEAD) -> None:
        self._envelope = Envelope(most)
        self._most_headed = head
        self._head: list[Buckets] = []
        self._headed = 0
        self._lines: list[tuple[Floats, Floats]] = []
        self._last_line: int | None = None
        self._changes = 0
        self._valued: set[str] = set()
        self.names: list[str] = []

    @classmethod
    def of(cls, columns: Columns) -> Envelopes:
        """The envelopes of a recording in memory."""
        envelopes = cls()
        envelopes.write(columns)
        return envelopes

    def write(self, columns: Columns) -> None:
        """Add a chunk; each has the same columns."""
        time_s = columns["time_s"]
        channels = channels_of(columns)
        if not len(time_s) or not channels:
            return
        self.names = list(channels)
        self._valued |= {name for name, v in channels.items() if not np.isnan(v).all()}
        values = np.vstack([v.astype(np.float32) for v in channels.values()])
        self._envelope.add(time_s, values)
        if self._headed < self._most_headed:
            part = Buckets.of(time_s, values).between(0, self._most_headed - self._headed)
            self._head.append(part)
            self._headed += len(part)
        if "line" in columns:
            self._note_lines(time_s, columns["line"])

    def __contains__(self, channel: str) -> bool:
        return channel in self._valued

    def overview(self) -> Buckets:
        """All of the recording; ValueError if nothing was written."""
        return self._envelope.buckets()

    def head(self) -> Buckets | None:
        """The first samples, each as it is, if the overview does not hold them so."""
        return together(self._head) if self._head and self.samples_per_bucket > 1 else None

    def beginning(self) -> Envelopes:
        """The envelopes of the first samples, each as it is."""
        first = Envelopes(max(self._headed, 1), 0)
        first.names, first._valued = self.names, self._valued
        first._lines, first._last_line = self._lines, self._last_line
        for part in self._head:
            first._envelope.add(part.start, part.first)
        return first

    def band(self, channel: str, scale: float = 1.0) -> Band:
        """The envelope of `channel`, its values times `scale` (positive)."""
        found, row = self.overview(), self.names.index(channel)
        first, second = (
            scale * ends[row].astype(np.float64) for ends in (found.first, found.second)
        )
        return Band((found.start + found.end) / 2, np.fmin(first, second), np.fmax(first, second))

    @property
    def samples_per_bucket(self) -> int:
        return self._envelope.size

    @property
    def axes(self) -> list[int]:
        """The axes with a command or a position, ascending."""
        named = (c.split("_") for c in self.names if c.startswith(("command_", "position_")))
        return sorted({int(parts[1]) for parts in named})

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return float(self.overview().end[-1])

    def changes(self) -> tuple[Floats, NDArray[np.int32]]:
        """Times at which the source line changes, and the line from then on."""
        if not self._lines:
            return np.zeros(0), np.zeros(0, dtype=np.int32)
        time_s, line = (np.concatenate(part) for part in zip(*self._lines, strict=True))
        return time_s, line.astype(np.int32)

    def _note_lines(self, time_s: Floats, line: Floats) -> None:
        before = line[0] - 1 if self._last_line is None else self._last_line
        self._last_line = int(line[-1])
        if self._changes < MOST_LINE_CHANGES:
            at = np.flatnonzero(np.diff(line, prepend=before))
            self._lines.append((time_s[at], line[at]))
            self._changes += len(at)


def channels_of(columns: Columns) -> dict[str, NDArray[Any]]:
    """The columns that are drawn, with the lags."""
    channels = {name: v for name, v in columns.items() if name not in ("time_s", "line")}
    for name, position in columns.items():
        n = name.split("_")[1] if name.startswith("position_") else ""
        if n and f"command_{n}_m" in columns:
            channels[LAG.format(n)] = columns[f"command_{n}_m"] - position
    return channels


def together(parts: Sequence[Buckets]) -> Buckets:
    """One after the other; the size is that of the first."""
    if len(parts) == 1:
        return parts[0]
    return Buckets(
        parts[0].size,
        np.concatenate([p.start for p in parts]),
        np.concatenate([p.end for p in parts]),
        np.concatenate([p.first for p in parts], axis=1),
        np.concatenate([p.second for p in parts], axis=1),
    )


def _one(parts: Sequence[Buckets]) -> Buckets:
    """All of single buckets in one."""
    whole = parts[0]
    for part in parts[1:]:
        first, second = _extremes(whole, part)
        whole = Buckets(whole.size, whole.start, part.end, first, second)
    return whole


def _extremes(one: Buckets, other: Buckets) -> tuple[Singles, Singles]:
    """Least and greatest of both, `one` being before the `other`, in the order of time."""
    low, low_after = np.fmin(one.first, one.second), np.fmin(other.first, other.second)
    high, high_after = np.fmax(one.first, one.second), np.fmax(other.first, other.second)
    low_is_after, high_is_after = low_after < low, high_after > high
    rising = np.where(low_is_after, other.first <= other.second, one.first <= one.second)
    low_first = np.where(low_is_after == high_is_after, rising, high_is_after)
    low, high = np.fmin(low, low_after), np.fmax(high, high_after)
    return np.where(low_first, low, high), np.where(low_first, high, low)
