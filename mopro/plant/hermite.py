"""The cubic between two nodes from its values and slopes there."""

from __future__ import annotations

from mopro.plant.command_table import Floats


def hermite(u: Floats, start: Floats, end: Floats, rise: Floats, fall: Floats) -> Floats:
    """The cubic Hermite polynomial at `u` of its interval, from 0 to 1.

    `start` and `end` are its values, `rise` and `fall` its slopes there times the
    interval's length. Only the intervals asked for are worked out: scipy's spline, which
    prepares them all, takes two to twenty times as long.
    """
    curve: Floats = (
        start * (1 + 2 * u) * (1 - u) ** 2
        + rise * u * (1 - u) ** 2
        + end * u**2 * (3 - 2 * u)
        - fall * u**2 * (1 - u)
    )
    return curve
