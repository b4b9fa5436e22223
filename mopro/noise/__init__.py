"""Noise of a sensor at standstill: level, memory, hum, converter's step, outliers.

Knows numpy and scipy alone. `report` takes times and readings and gives a `NoiseReport`.
"""

from mopro.noise.ends import End, ends_of
from mopro.noise.odd import level_between, stuck_of
from mopro.noise.report import Estimate, NoiseReport, TooShort, report
from mopro.noise.step import step_of

__all__ = [
    "End", "Estimate", "NoiseReport", "TooShort", "ends_of", "level_between", "report", "step_of",
    "stuck_of",
]  # fmt: skip
