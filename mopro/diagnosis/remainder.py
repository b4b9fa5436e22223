"""What is left when the effects are taken out: whether it is noise, and what it looks like."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal, stats

from mopro.diagnosis.model import Floats, Series

# A false alarm in one of a thousand remainders that are noise, over all tests together.
FALSE_ALARMS = 1e-3
_FEWEST = 60
_POSITION_LINES = 2000


@dataclass(frozen=True)
class Remainder:
    """Whether what is left is more than noise, and the most telling shape in it."""

    significant: bool
    description: str | None
    p_value: float


@dataclass(frozen=True)
class _Finding:
    p_value: float
    description: str | None


def examine(data: Sequence[Series], residual: Floats, parameters: int) -> Remainder:
    """Test the whitened `residual` of series with known noise.

    `parameters` is how many numbers were fitted to it. Series with unknown noise have
    nothing to be compared with, and are left out.
    """
    tests = [_excess(residual, parameters)] if all(s.sigma for s in data) else []
    start = 0
    for series in data:
        own = residual[start : start + len(series)]
        start += len(series)
        if series.sigma is not None and len(series) >= _FEWEST:
            tests.extend(_shapes(series, own))
    if not tests:
        return Remainder(False, None, 1.0)
    worst = min(test.p_value for test in tests)
    p_value = min(1.0, worst * len(tests))
    if p_value >= FALSE_ALARMS:
        return Remainder(False, None, p_value)
    described = [test for test in tests if test.description]
    telling = min(described, key=lambda test: test.p_value, default=None)
    clear = telling is not None and telling.p_value * len(tests) < FALSE_ALARMS
    words = telling.description if telling and clear else "more scatter than the sensor's noise"
    return Remainder(True, words, p_value)


def _excess(residual: Floats, parameters: int) -> _Finding:
    freedom = max(len(residual) - parameters, 1)
    return _Finding(float(stats.chi2.sf(residual @ residual, freedom)), None)


def _shapes(series: Series, z: Floats) -> Iterator[_Finding]:
    yield _memory(z)
    if series.time_s is not None:
        yield _drift(series, series.time_s, z)
        yield _line_in_time(series, series.time_s, z)
    position = series.labels.get("position")
    if position is not None and np.ptp(position) > 0:
        yield _line_in_position(series, np.asarray(position, dtype=float), z)


def _memory(z: Floats) -> _Finding:
    """Bartlett's test (1955): the cumulative periodogram of white noise is a straight line."""
    power = np.abs(np.fft.rfft(z - z.mean()))[1 : (len(z) + 1) // 2] ** 2
    shares = np.cumsum(power)[:-1] / (power.sum() or 1.0)
    return _Finding(float(stats.kstest(shares, "uniform", method="asymp").pvalue), None)


def _drift(series: Series, time_s: Floats, z: Floats) -> _Finding:
    centred = time_s - time_s.mean()
    slope = float(centred @ z / (centred @ centred))
    strength = abs(slope) * math.sqrt(float(centred @ centred))
    total = slope * (series.sigma or 1.0) * float(np.ptp(time_s))
    words = f"a drift in time of {total:.3g} {series.unit} over {series.run}"
    return _Finding(float(2 * stats.norm.sf(strength)), words)


def _line_in_time(series: Series, time_s: Floats, z: Floats) -> _Finding:
    """The strongest line of the periodogram (evenly sampled)."""
    n = len(z)
    power = np.abs(np.fft.rfft(z - z.mean()))[1 : (n + 1) // 2] ** 2 / n
    at = int(np.argmax(power))
    frequency = (at + 1) / (n * float(np.median(np.diff(time_s))))
    amplitude = 2 * math.sqrt(power[at] / n) * (series.sigma or 1.0)
    words = f"a line at {frequency:.3g} Hz in time, {amplitude:.2g} {series.unit}, in {series.run}"
    return _Finding(_line_chance(float(power[at]), len(power)), words)


def _line_in_position(series: Series, position: Floats, z: Floats) -> _Finding:
    """The strongest line over position, down to a period of four mean sample distances."""
    reach = float(np.ptp(position))
    finest = 4 * float(np.mean(np.abs(np.diff(position))) or reach)
    cycles = np.linspace(1 / reach, max(2 / reach, 1 / finest), _POSITION_LINES)
    power = signal.lombscargle(position, z - z.mean(), 2 * math.pi * cycles)
    at = int(np.argmax(power))
    words = f"a line in position with a period of {1 / cycles[at]:.3g} in {series.run}"
    return _Finding(_line_chance(float(power[at]), len(cycles)), words)


def _line_chance(power: float, lines: int) -> float:
    """How often the strongest of `lines` lines of white noise of variance 1 is as strong."""
    return float(-math.expm1(lines * math.log1p(-math.exp(-power)))) if power > 0 else 1.0
