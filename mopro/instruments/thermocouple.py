"""The thermocouple chain of chapter 3.2: 0 to 200 °C on 0 to 5 V, C = counts/10.24.

One reading a second for the first two minutes, then one every 15 s, up to 1921 of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

COUNTS_PER_C = 10.24


@dataclass(frozen=True)
class Thermocouple:
    fast_readings: int = 120
    fast_s: float = 1.0
    slow_s: float = 15.0
    readings: int = 1921
    highest_C: float = 200.0

    def times_s(self, duration_s: float) -> Floats:
        """Times (s) of the readings in a run of this duration."""
        fast = np.arange(self.fast_readings) * self.fast_s
        slow = np.arange(self.readings - self.fast_readings) * self.slow_s
        times = np.concatenate((fast, self.fast_readings * self.fast_s + slow))
        return times[times <= duration_s + 1e-9]

    def stored_C(self, temperature_C: Floats) -> Floats:
        """Stored temperatures (°C): whole counts within the range."""
        most = round(self.highest_C * COUNTS_PER_C)
        counts = np.clip(np.rint(temperature_C * COUNTS_PER_C), 0, most)
        stored: Floats = counts / COUNTS_PER_C
        return stored
