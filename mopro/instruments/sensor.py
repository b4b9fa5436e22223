"""One sensor of an experiment: its quantity, column, unit, rate and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mopro.engine.tolerances import Tolerances
from mopro.errors import DataError
from mopro.instruments.quantity import Quantity
from mopro.units import UNITS


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
