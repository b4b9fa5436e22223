"""Extremes of long series in a bounded number of buckets, as the samples arrive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


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
