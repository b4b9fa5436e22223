"""Runge-Kutta's method under inputs that hold from row to row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

State = Sequence[float]
Rates = Callable[[float, State], State]


def stepped(rates: Rates, t: float, state: State, h: float) -> list[float]:
    """The state after a step of `h` by the classical method of fourth order."""

    def moved(by: State, share: float) -> list[float]:
        return [s + share * d for s, d in zip(state, by, strict=True)]

    a = rates(t, state)
    b = rates(t + h / 2, moved(a, h / 2))
    c = rates(t + h / 2, moved(b, h / 2))
    d = rates(t + h, moved(c, h))
    return [
        s + h / 6 * (p + 2 * q + 2 * r + u) for s, p, q, r, u in zip(state, a, b, c, d, strict=True)
    ]


def pieces(times: Sequence[float], delay: float) -> list[tuple[int, int, float, float]]:
    """Stretches with one input each: the row before it, the row of its input, begin and end (s).

    The input of a row holds from its time plus `delay` to that of the next; before, the first's.
    """
    found = []
    given = 0
    late = [t + delay for t in times]
    while given + 1 < len(times) and late[given + 1] <= times[0]:
        given += 1
    for row, (begin, end) in enumerate(pairwise(times)):
        while given + 1 < len(times) and late[given + 1] < end:
            if late[given + 1] > begin:
                found.append((row, given, begin, late[given + 1]))
                begin = late[given + 1]
            given += 1
        found.append((row, given, begin, end))
    return found
