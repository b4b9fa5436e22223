"""A sensor whose coupling has play."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mopro.diagnosis.model import Candidate
from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View

# From this many samples on, importing a compiler pays.
_LONG = 20_000


def _play(x: Floats, half: float, followed: Floats) -> None:
    """What is dragged along with `half` of play to either side, from the first place on."""
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

    x' = x - B/2 sgn(direction of the last motion), B in m: a play that the motion
    crosses before the sensor follows, centred where it starts. Source: assumed.
    """

    name = "backlash"
    domain = Domain.MEASUREMENT
    parameters = (Parameter("B", "m", "length", 2e-5, (1e-6, 1e-4), 0.0, 0.01, "reversal step"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        followed = np.empty_like(x)
        play = _compiled_play() if len(x) >= _LONG else _play
        play(x, p[0] / 2, followed)
        return followed

    def forms(self, view: View) -> Iterator[Candidate]:
        # Each further micrometre has fewer rings to take its slack up in.
        yield self.form(replace(self.fitted("B", 3e-6, 3e-5), difference=1e-5))
