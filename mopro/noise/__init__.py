"""Noise of a sensor at standstill: level, memory, hum, converter's step, outliers.

Knows numpy and scipy alone. `report` takes times and readings and gives a `NoiseReport`.
"""

from mopro.noise.report import Estimate, NoiseReport, TooShort, report

__all__ = ["Estimate", "NoiseReport", "TooShort", "report"]
