"""Slips of units: the factor by which readings are off where one thing is taken for another."""

from __future__ import annotations

import math

_DEGREES = 180 / math.pi

# Readings over true values -> the unit that they are in, and the one that they are taken for.
UNIT_SLIPS = {
    _DEGREES: ("degrees", "radians"),
    1 / _DEGREES: ("radians", "degrees"),
    25.4: ("millimetres", "inches"),
    1 / 25.4: ("inches", "millimetres"),
}
# Readings over true values -> the slip, of what is counted or measured twice or four times.
FOLD_SLIPS = {
    2.0: "a factor of 2, such as a radius for a diameter",
    0.5: "a factor of 1/2, such as a diameter for a radius",
    4.0: "a factor of 4, such as quadrature counts for the lines of an encoder",
    0.25: "a factor of 1/4, such as the lines of an encoder for quadrature counts",
}
