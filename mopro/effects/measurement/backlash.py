"""A sensor whose coupling has play."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mopro.diagnosis.model import Candidate
from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View

# Samples from which importing the compiler takes less time than it saves.
_COMPILE_FROM = 20_000


def _play(x: Floats, half: float, followed: Floats) -> None:
    """Fill `followed` with the position (m) of a part dragged by `x` with play ±`half`."""
    at = x[0] if len(x) else 0.0
    for i in range(len(x)):
        at = min(max(at, x[i] - half), x[i] + half)
        followed[i] = at


@functools.cache
def _compiled_play() -> Callable[[Floats, float, Floats], None]:
    import numba

    compiled: Callable[[Floats, float, Floats], None] = numba.njit(cache=True, nogil=True)(_play)
    return compiled


class Backlash(Effect):
    """The sensor's coupling has play.

    x' = x - B/2 sgn(direction of the last motion), B in m: after a reversal the axis
    crosses the play before the sensor follows; it starts in the middle. Source: assumed.
    """

    name = "backlash"
    domain = Domain.MEASUREMENT
    parameters = (Parameter("B", "m", "length", 2e-5, (1e-6, 1e-4), 0.0, 0.01, "reversal step"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        followed = np.empty_like(x)
        play = _compiled_play() if len(x) >= _COMPILE_FROM else _play
        play(x, p[0] / 2, followed)
        return followed

    def forms(self, view: View) -> Iterator[Candidate]:
        # The response is not smooth: fewer oscillations cross a larger play.
        yield self.form(replace(self.fitted("B", 3e-6, 3e-5), difference=1e-5))
