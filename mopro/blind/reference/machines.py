"""Machines beside the motor, simulated from their equations: an axis, nodes, a slide, an effort.

A plant gives the readings of its sensors, shape (sensors, rows), for the columns of one run, its
numbers, and effects by name with their parameters: SI throughout, temperatures in °C. An effect
that is not given is off.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.blind.reference import axis, effort, kinematic, thermal

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]
Columns = dict[str, Floats]
Plant = Callable[[Mapping[str, Floats], Mapping[str, float], Effects], Floats]

PLANTS: dict[str, Plant] = {
    "axis": axis.readings,
    "kinematic": kinematic.readings,
    "thermal": thermal.readings,
    "effort": effort.readings,
    # Somebody's program of a slide.
    "python": kinematic.readings,
}
