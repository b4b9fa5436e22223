"""Noise of a sensor at standstill: level, memory, hum, converter's step, outliers.

Knows numpy and scipy alone. `report` takes times and readings and gives a `NoiseReport`.
"""

from mopro.noise.report import Estimate, NoiseReport, TooShort, report
from mopro.noise.values import End, ends_of, level_between, step_of, stuck_of

__all__ = [
    "End", "Estimate", "NoiseReport", "TooShort", "ends_of", "level_between", "report", "step_of",
    "stuck_of",
]  # fmt: skip
