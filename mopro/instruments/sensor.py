"""One sensor of an experiment: its quantity, column, unit, rate and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mopro.errors import DataError
from mopro.units import UNITS

POSITION, TEMPERATURE = "position", "temperature"


@dataclass(frozen=True)
class Sensor:
    """One sensor of an experiment.

    `column` ends in its unit (`position_1_in`, `temperature_C`); noise_rms and adc_step
    are in that unit.
    """

    name: str
    quantity: str
    column: str
    rate_hz: float
    axis: int = 1
    noise_rms: float = 0.0
    adc_step: float = 0.0

    @property
    def unit_si(self) -> float:
        """The column's unit in SI; DataError if there is none that fits."""
        suffix = self.column.rsplit("_", 1)[-1]
        dimension = {POSITION: "length", TEMPERATURE: "temperature"}.get(self.quantity)
        kind, factor = UNITS.get(suffix, ("", 1))
        if dimension is None or kind != dimension:
            message = f"sensor {self.name}: column {self.column} has no unit of a {self.quantity}"
            raise DataError(message, "wrong-unit")
        return float(factor)

    @property
    def sigma(self) -> float:
        """The standard deviation of a reading: its noise and the converter's rounding."""
        return math.hypot(self.noise_rms, self.adc_step / math.sqrt(12))
