"""Play: a part that follows another one only after a gap is crossed."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from mopro.engine.compiled import compiled

Floats = NDArray[np.float64]

# Samples from which importing the compiler, unless that is done, takes less time than it saves.
_COMPILE_FROM = 20_000


def follow(x: Floats, half: float, begun: float = 0.0) -> Floats:
    """Positions of a part that is dragged by `x` with play ± `half`.

    `begun`: where it is in its play at first, from -1 (driven forwards so far) to 1 (backwards).
    """
    followed = np.empty_like(x)
    worth_it = "numba" in sys.modules or len(x) >= _COMPILE_FROM
    fill = _fill_fast if worth_it else _fill
    fill(x, half, begun, followed)
    return followed


def _fill(x: Floats, half: float, begun: float, followed: Floats) -> None:
    at = x[0] + begun * half if len(x) else 0.0
    for i in range(len(x)):
        at = min(max(at, x[i] - half), x[i] + half)
        followed[i] = at


_fill_fast = compiled(_fill)
