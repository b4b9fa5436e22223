"""Stretches of a record in which the signal stands still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stretch = tuple[int, int]

# Readings of one window, a share of all within limits; a stretch has at least two windows. Halved,
# a window's noise is known worse, and moves pass for it; doubled, short rests are not found.
_WINDOWS = (8, 32)
_WINDOW_SHARE = 40
_FEWEST_WINDOWS = 2
# Window RMS about its mean, in that of the quietest tenth. Of 8 normal readings one window in
# 3000 exceeds it, of 32 none; noise with a memory stays below it too. Doubled, slow motion is rest.
_STILL = 3.0
# Share of the windows that are taken to be at rest. Halved, a window that is quiet by chance sets
# the level; doubled, records that rest for less than a fifth of their time set it by a motion.
_QUIET_SHARE = 0.1
# Windows of one stretch whose medians differ by more than this many window RMS are apart: those
# of 8 normal readings differ by 0.6. Doubled, creep of a noise's width per window is rest.
_APART = 4.0
# Share of a stretch's variance that a parabola may take: more is a motion. Halved, slow noise is.
_MOST_TREND = 0.5


def stretches_of(values: Floats, step: float = 0.0) -> list[Stretch]:
    """Index ranges (start, end) of standstill, in order; none if the signal never stands.

    `values` (n) have no NaN. The first window after a motion settles and is left out. A signal
    that crosses between two codes of a converter of `step` still stands.
    """
    least, most = _WINDOWS
    window = min(max(len(values) // _WINDOW_SHARE, least), most)
    windows = len(values) // window
    if windows < _FEWEST_WINDOWS:
        return []
    blocks = values[: windows * window].reshape(windows, window)
    means, rms = np.median(blocks, axis=1), _robust_rms(blocks)
    quiet = max(float(np.quantile(rms, _QUIET_SHARE)), 0.5 * step)
    still = rms <= max(_STILL * quiet, 0.6 * step)
    joined = np.abs(np.diff(means)) <= _APART * np.maximum(quiet, 0.5 * step)
    found = [_settled(run, still) for run in _runs(still, joined)]
    limits = [(first * window, last * window) for first, last in found]
    return [
        (start, end)
        for start, end in limits
        if end - start >= _FEWEST_WINDOWS * window and _stands(values[start:end], step)
    ]


def _robust_rms(blocks: Floats) -> Floats:
    """RMS of each row about its median, without the reading farthest from it (an outlier)."""
    squares = (blocks - np.median(blocks, axis=1)[:, None]) ** 2
    rest = np.maximum(squares.sum(axis=1) - squares.max(axis=1), 0.0)
    rms: Floats = np.sqrt(rest / (blocks.shape[1] - 1))
    return rms


def _runs(still: NDArray[np.bool_], joined: NDArray[np.bool_]) -> list[Stretch]:
    """Runs of windows that are still and joined to their neighbours."""
    edges = np.concatenate(([True], ~(joined & still[1:] & still[:-1]), [True]))
    starts = np.flatnonzero(edges)
    pairs = zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)
    return [(a, b) for a, b in pairs if still[a]]


def _settled(run: Stretch, still: NDArray[np.bool_]) -> Stretch:
    """The run without its first and last windows where they touch a motion, if it is long."""
    first, last = run
    if last - first < 2 * _FEWEST_WINDOWS:
        return run
    return first + (first > 0), last - (last < len(still))


def _stands(values: Floats, step: float) -> bool:
    """False if a parabola takes most of the variance and more than a converter's rounding."""
    x = np.linspace(-1.0, 1.0, len(values))
    residual = values - np.polynomial.Polynomial.fit(x, values, 2)(x)
    total, left = float(values.var()), float(residual.var())
    return total <= (0.6 * step) ** 2 or left >= (1 - _MOST_TREND) * total
