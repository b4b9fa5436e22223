"""The stop beyond a limit switch."""

from __future__ import annotations

import math

from mopro.effects.base import Domain, Effect, Parameter


class PlatenEdge(Effect):
    """The mechanical stop of the forcer beyond its limit switch.

    F = -K (x - edge) - C ẋ outside of [low, high] (m), a stiff and well damped contact.
    Source: assumed. Not in the catalogue: every machine has it, few runs reach it.
    """

    name = "platen_edge"
    domain = Domain.DYNAMICS
    parameters = tuple(
        Parameter(n, "m", "length", 0.0, (-1, 1), -math.inf, math.inf, f"{n} edge")
        for n in ("low", "high")
    )

    @staticmethod
    def force(x: float, v: float, low: float, high: float) -> float:
        if low <= x <= high:
            return 0.0
        edge = high if x > high else low
        return -2.0e6 * (x - edge) - 2.0e3 * v


# One object for all runs, as kernels are cached by their effects.
PLATEN_EDGE = PlatenEdge()
