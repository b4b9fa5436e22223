"""One sensor of an experiment: its quantity, column, unit, rate, noise and tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mopro.engine.tolerances import CLOCK, GAIN, LINEARITY, RANGE, Tolerances
from mopro.errors import DataError
from mopro.instruments.quantity import Quantity
from mopro.tomlfile import Value
from mopro.tomlfile.schema import number, number_in
from mopro.units import UNITS

# -- the sensor -------------------------------------------------------------------------------
# One sensor of an experiment: its quantity, column, unit, rate and noise.


@dataclass(frozen=True)
class Sensor:
    """One sensor of an experiment.

    `column` ends in its unit (`position_1_in`, `temperature_C`); noise_rms and adc_step
    are in that unit. `linearity` (in that unit), `gain_tolerance`, `clock_tolerance` and
    `range`: see Tolerances.
    """

    name: str
    quantity: Quantity
    column: str
    rate_hz: float
    axis: int = 1
    noise_rms: float = 0.0
    adc_step: float = 0.0
    linearity: float = 0.0
    gain_tolerance: float = 0.0
    clock_tolerance: float = 0.0
    range: tuple[float, float] | float | None = None

    @property
    def tolerances(self) -> Tolerances:
        """The stated standard uncertainties of the sensor."""
        return Tolerances(self.linearity, self.gain_tolerance, self.clock_tolerance, self.range)

    @property
    def unit(self) -> str:
        """The unit that the column is named after."""
        return self.column.rsplit("_", 1)[-1]

    @property
    def recorded_column(self) -> str:
        """The column of a recording that carries what the sensor measures, in SI."""
        return self.quantity.recorded_column(self.axis)

    @property
    def unit_si(self) -> float:
        """The column's unit in SI; DataError if there is none that fits."""
        kind, factor = UNITS.get(self.unit, ("", 1))
        if kind != self.quantity.dimension:
            message = f"sensor {self.name}: column {self.column} has no unit of a {self.quantity}"
            raise DataError(message, "wrong-unit")
        return float(factor)

    @property
    def sigma(self) -> float:
        """The standard deviation of a reading: its noise and the converter's rounding."""
        return math.hypot(self.noise_rms, self.adc_step / math.sqrt(12))


# -- stated tolerances ------------------------------------------------------------------------
# The keys of a [[sensor]] that state its tolerances, and their readers.


def _range(value: Value) -> tuple[float, float] | float:
    """`[low, high]`, or a length."""
    ends = value.data if isinstance(value.data, list) else [0.0, value.data]
    match [number_in(end) for end in ends]:
        case [float() as low, float() as high] if low < high:
            return (low, high) if isinstance(value.data, list) else high
    raise value.refused(
        f"expected {value.key} = [-10.0, 10.0], the ends in the unit of the column, or its length"
    )


TOLERANCES: dict[str, Callable[[Value], Any]] = {
    LINEARITY: number(0.0),
    GAIN: number(0.0, 1.0),
    CLOCK: number(0.0, 1.0),
    RANGE: _range,
}


def read_tolerances(entry: Value) -> Tolerances:
    """The tolerances of a [[sensor]]; faults are reported at their keys."""
    stated = {key: entry.get(key, read, None) for key, read in TOLERANCES.items() if key in entry}
    linearity, gain, clock = (stated.get(key) or 0.0 for key in (LINEARITY, GAIN, CLOCK))
    return Tolerances(linearity, gain, clock, stated.get(RANGE))


# -- slips of units ---------------------------------------------------------------------------
# Slips of units: the factor by which readings are off where one thing is taken for another.

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
