"""The sampling of a clock: its usual interval, whether it is regular, and its gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

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
