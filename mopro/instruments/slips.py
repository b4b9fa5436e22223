"""Slips of units: the factor by which readings are off where one unit is taken for another."""

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
