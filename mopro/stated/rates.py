"""Rates of a sampled position: derivatives of polynomials through the rows around each row.

A polynomial of degree 4 through 2 m + 1 rows, fitted by least squares, has a derivative that is off
by O(h^4) for m = 2, and by less noise the larger m is. The width is the largest one of which no
narrower one tells a bias (Lepski 1991): their difference has the power that noise gives it, or less
than twice as much. The noise of the position is what polynomials through seven rows leave, in which
smooth motion of many rows a period hardly shows. A central difference, taken twice, is off by
(w h)^2 / 3 of an acceleration of angular frequency w: more than the noise of a good sensor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Derive = Callable[[Floats], Floats]
_DEGREE = 4
# Rows on each side of a row that are tried.
_WIDTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32)
# Usual intervals that are a gap: what moved within it is not known.
GAP = 5.0
# Share of an interval by which even times may differ, as by rounding.
_EVEN = 1e-3
# Width of the polynomials that tell the noise, and most numbers that a derivative is kept as.
_LOCAL, _MOST_WEIGHTS = 3, 20_000_000
# Power of a difference, in that which noise gives it, from which on it tells a bias.
_MORE = 2.0
# The median of the absolute value of a normal variable.
_MEDIAN = 0.6745


@dataclass(frozen=True)
class Rates:
    """First and second derivative (n) of signals that are sampled as a certain position was.

    `first` and `second` take the values (n) of a signal at these times.
    """

    time_s: Floats
    first: Derive
    second: Derive

    @staticmethod
    def of(time_s: Floats, position: Floats) -> Rates:
        """Rates over the widths that suit the noise of `position` (n), sampled at `time_s` (n)."""
        noise = noise_of(time_s, position)
        return Rates(time_s, *(_best(time_s, position, noise, order) for order in (1, 2)))

    def velocity(self, position: Floats) -> Floats:
        """The first derivative, exactly 0 in a row that both of its neighbours are equal to."""
        equal = np.diff(position) == 0
        rests = np.r_[True, equal] & np.r_[equal, True]
        return np.where(rests, 0.0, self.first(position))


def rate_between(values: Floats, time_s: Floats) -> Floats:
    """The first derivative by the rows before and after each row; 0 of a single row."""
    return np.gradient(values, time_s) if len(values) > 1 else np.zeros_like(values)


def noise_of(time_s: Floats, position: Floats, *, resting: bool = False) -> float:
    """Standard deviation of white noise on a signal (n) at its times (n), where it changes.

    `resting`: rows that do not change count as well.
    """
    if len(position) <= 2 * _LOCAL:
        return 0.0
    smooth, white = derivative(time_s, _LOCAL, 0), _white(len(position))
    left = np.abs(position - smooth(position))
    moving = left if resting else left[left > 0]
    if not len(moving):
        return 0.0
    return float(np.median(moving)) / _MEDIAN / float(np.std(white - smooth(white)))


def _best(time_s: Floats, position: Floats, noise: float, order: int) -> Derive:
    """The derivative over the largest width that differs from all narrower ones as noise makes it.

    What noise does is told by white noise at the same times.
    """
    white = _white(len(position))
    best = derivative(time_s, _WIDTHS[0], order)
    narrower = [(best(position), best(white))]
    for width in _WIDTHS[1:]:
        rows = 2 * width + 1
        if rows > len(position) or rows * len(position) > _MOST_WEIGHTS:
            break
        wide = derivative(time_s, width, order)
        seen, noisy = wide(position), wide(white)
        if any(_power(seen - s) > _MORE * noise**2 * _power(noisy - n) for s, n in narrower):
            break
        narrower.append((seen, noisy))
        best = wide
    return best


def _power(values: Floats) -> float:
    return float(np.mean(values**2))


def _white(count: int) -> Floats:
    return np.random.default_rng(0).standard_normal(count)


def derivative(time_s: Floats, width: int, order: int) -> Derive:
    """The derivative of an order by so many rows on each side, or fewer where a part is short.

    No polynomial goes over a gap.
    """
    parts = [(part, _of_part(time_s[part], width, order)) for part in _parts(time_s)]

    def derive(values: Floats) -> Floats:
        found = np.empty(len(values))
        for part, own in parts:
            # A constant has no derivative, to the last digit.
            first = values[part.start]
            found[part] = own(values[part] - first) + (first if order == 0 else 0.0)
        return found

    return derive


def _of_part(time_s: Floats, width: int, order: int) -> Derive:
    width = min(width, (len(time_s) - 1) // 2)
    if 2 * width < _DEGREE:
        return partial(_by_neighbours, time_s, order)
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    if np.ptp(intervals) > _EVEN * usual:
        return partial(_weighed, *_weights(time_s, width, order))
    times: Floats = usual * np.arange(2.0 * width + 1)
    _, weights = _weights(times, width, order)
    return partial(_weighed_alike, weights)


def _by_neighbours(time_s: Floats, order: int, values: Floats) -> Floats:
    for _ in range(order):
        values = rate_between(values, time_s)
    return values


def _parts(time_s: Floats) -> Iterator[slice]:
    """The stretches of the rows without a gap."""
    intervals = np.diff(time_s)
    usual = float(np.median(intervals)) if len(intervals) else 0.0
    cuts = [0, *(np.flatnonzero(intervals > GAP * usual) + 1).tolist(), len(time_s)]
    for begin, end in pairwise(cuts):
        yield slice(begin, end)


def _weights(time_s: Floats, width: int, order: int) -> tuple[NDArray[np.int64], Floats]:
    """The first row (n) of the polynomial of each row, and the weights (n x rows) of its rows."""
    rows = 2 * width + 1
    begins = np.clip(np.arange(len(time_s)) - width, 0, len(time_s) - rows)
    times = sliding_window_view(time_s, rows)[begins]
    middle, half = (times[:, :1] + times[:, -1:]) / 2, (times[:, -1:] - times[:, :1]) / 2
    powers = ((times - middle) / half)[:, :, None] ** np.arange(_DEGREE + 1)
    at = (time_s[:, None] - middle) / half
    slopes = np.zeros((len(time_s), _DEGREE + 1))
    for power in range(order, _DEGREE + 1):
        slopes[:, power] = math.perm(power, order) * at[:, 0] ** (power - order)
    solved = np.linalg.solve(powers.transpose(0, 2, 1) @ powers, slopes[:, :, None])
    return begins, (powers @ solved)[:, :, 0] / half**order


def _weighed_alike(weights: Floats, values: Floats) -> Floats:
    """The weights (rows x rows) of one polynomial along all rows; those at its ends at the ends."""
    rows, middle = len(weights), len(weights) // 2
    ends = weights[:middle] @ values[:rows], weights[middle + 1 :] @ values[-rows:]
    return np.concatenate([ends[0], np.correlate(values, weights[middle], "valid"), ends[1]])


def _weighed(begins: NDArray[np.int64], weights: Floats, values: Floats) -> Floats:
    rows = sliding_window_view(values, weights.shape[1])[begins]
    found: Floats = np.einsum("ij,ij->i", rows, weights)
    return found
