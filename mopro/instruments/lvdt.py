"""The LVDT of chapter 4.2 and its 12-bit converter.

A Lucas Schaevitz DCE2000: ±10 V for ±10 in, 25 mV RMS of ripple, linear within 0.25 % of
the full range, read 960 times at 800 Hz (5 MHz / 6250; the listing's comment says
200 Hz) over ±10 V in 4096 steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.units import INCH_M

Floats = NDArray[np.float64]

FULL_SCALE_V = 10.0
CODES = 4096
AVERAGED = 40


@dataclass(frozen=True)
class Lvdt:
    """One LVDT, its middle at `middle_m` of the axis' own coordinate.

    `linearity` is the deviation at the ends of the range as a share of the full range; it
    grows with the third power of the distance from the middle (appendix D.1).
    """

    middle_m: float = 0.0
    half_range_m: float = 10 * float(INCH_M)
    ripple_V: float = 0.025
    linearity: float = 0.0025
    rate_hz: float = 800.0
    samples: int = 960

    @property
    def step_V(self) -> float:
        """One step of the converter, 4.883 mV."""
        return 2 * FULL_SCALE_V / CODES

    def times_s(self) -> Floats:
        return np.arange(self.samples) / self.rate_hz

    def volts(self, position_m: Floats, generator: np.random.Generator | None = None) -> Floats:
        """Stored voltages for the core at `position_m`; without `generator`, no ripple.

        Beyond its range the converter stays at its last code.
        """
        u = (position_m - self.middle_m) / self.half_range_m
        volts = FULL_SCALE_V * (u + 2 * self.linearity * u**3)
        if generator is not None:
            volts = volts + generator.normal(0.0, self.ripple_V, len(volts))
        codes = np.clip(np.rint(volts / self.step_V), -CODES // 2, CODES // 2 - 1)
        stored: Floats = codes * self.step_V
        return stored

    def position_m(self, volts: Floats) -> Floats:
        """The position for stored volts, taking the transducer to be linear."""
        return self.middle_m + volts / FULL_SCALE_V * self.half_range_m


def block_velocity(
    position_m: Floats, rate_hz: float, averaged: int = AVERAGED
) -> tuple[Floats, Floats]:
    """Times (s) and velocity (m/s) as the thesis derives them (chapter 4.2.2).

    Positions are averaged in blocks of `averaged`, and the averages differenced.
    """
    blocks = len(position_m) // averaged
    means = position_m[: blocks * averaged].reshape(blocks, averaged).mean(axis=1)
    interval_s = averaged / rate_hz
    times = (np.arange(1, blocks) - 0.5 / averaged) * interval_s
    velocity: Floats = np.diff(means) / interval_s
    return np.asarray(times, dtype=np.float64), velocity
