"""Spectral lines (hum) in stretches of noise: frequency, amplitude, interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, optimize, signal

from mopro.noise.values import Floats

# Chance that noise alone shows a line somewhere in the spectrum. Doubled, one record in 500 does.
_FALSE_ALARM = 1e-3
# Lines of one record: hum and its harmonics are fewer. Doubled, a record with more takes longer.
_MOST_LINES = 8
# Bins whose median is the background of the one in their middle. Halved, its level is known to
# 32 % instead of 22 and a line must be stronger; doubled, a bend of the spectrum passes for a line.
_BACKGROUND_BINS = 61
# Degrees of freedom of its median, half of those of a mean: neighbours of a Hann window correlate.
_BACKGROUND_FREEDOM = 20.0
# Bins of a spectrum that is looked at: half of them are background. Doubled, records of less than
# 140 readings show no lines, instead of 76.
_LEAST_BINS = 32
# Readings of a stretch that are looked at, for time and memory (2 MB). Doubled, twice of both.
_LONGEST = 1 << 18
# Periods that the stretch has at least: a slower wave is not told from a drift. Doubled, those of
# six to twelve periods are a memory of the noise.
_FEWEST_PERIODS = 6
# Bins below a line that must not be nearly as strong: beyond its own width, which is two bins of a
# Hann window. Halved, a line hides itself; doubled, a steep rise passes for a line.
_NEIGHBOURS = (3, 12)
# Normal quantile of 95 %.
_Z95 = 1.96
_MAINS_HZ = (50.0, 60.0)


@dataclass(frozen=True)
class Line:
    """A sine in the readings: frequency (Hz) and amplitude with half their 95 % intervals."""

    frequency_hz: float
    frequency_ci_hz: float
    amplitude: float
    amplitude_ci: float
    rate_hz: float

    def lasts(self, readings: int) -> bool:
        """True if so many readings see a period of it: in fewer it is not told from their level."""
        return readings * self.frequency_hz >= self.rate_hz

    @property
    def mains_hz(self) -> float | None:
        """50, 60 Hz or a harmonic if the line is that, or its alias at this sampling rate."""
        tolerance = max(3 * self.frequency_ci_hz, 2e-3 * self.rate_hz)
        for base in _MAINS_HZ:
            for multiple in (1, 2, 3):
                true = base * multiple
                seen = abs(true - self.rate_hz * round(true / self.rate_hz))
                if seen > tolerance and abs(seen - self.frequency_hz) < tolerance:
                    return true
        return None


def lines_of(values: Floats, rate_hz: float) -> list[Line]:
    """The lines of one stretch that stand out of the spectrum around them, strongest first."""
    values = np.asarray(values[:_LONGEST], float) - float(np.mean(values[:_LONGEST]))
    found: list[Line] = []
    while len(found) < _MOST_LINES:
        line = _strongest(values, rate_hz)
        if line is None:
            break
        found.append(line)
        values = without_lines(values, [line], rate_hz)
    return sorted(found, key=lambda line: -line.amplitude)


def without_lines(values: Floats, lines: list[Line], rate_hz: float) -> Floats:
    """The readings less the sines of `lines`, fitted with a phase of this stretch."""
    lines = [line for line in lines if line.lasts(len(values))]
    if not lines:
        return values
    design = np.column_stack([_waves(x.frequency_hz, len(values), rate_hz) for x in lines])
    mean = float(values.mean())
    weights = _weights(design, values - mean)
    less: Floats = values - design @ weights
    return less


def _waves(frequency_hz: float, count: int, rate_hz: float) -> Floats:
    phase = 2 * np.pi * frequency_hz / rate_hz * np.arange(count)
    return np.column_stack([np.sin(phase), np.cos(phase)])


def _weights(design: Floats, values: Floats) -> Floats:
    """Least squares by the normal equations: sines of distinct lines are nearly orthogonal."""
    normal = np.linalg.lstsq(design.T @ design, design.T @ values, rcond=1e-10)[0]
    return np.asarray(normal, np.float64)


def _strongest(values: Floats, rate_hz: float) -> Line | None:
    frequencies, power = signal.periodogram(values, rate_hz, "hann", detrend="linear")
    frequencies, power = frequencies[_FEWEST_PERIODS:-1], power[_FEWEST_PERIODS:-1]
    if len(power) < _LEAST_BINS or not power.any():
        return None
    background = _background(power)
    excess = power / background / _threshold(len(power))
    best = int(np.argmax(excess))
    if excess[best] < 1:
        return None
    return _refined(values, rate_hz, float(frequencies[best]), float(background[best]))


def _background(power: Floats) -> Floats:
    """Mean level around each bin, never below that of the bins just under it.

    The running median of exponential values, over ln 2; the neighbours below count where the
    spectrum rises steeply towards low frequencies.
    """
    width = min(_BACKGROUND_BINS, len(power) // 2 * 2 - 1)
    level: Floats = ndimage.median_filter(power, width, mode="reflect") / np.log(2)
    low, high = _NEIGHBOURS
    sums = np.concatenate(([0.0], np.cumsum(power)))
    index = np.arange(len(power))
    first, last = np.maximum(index - high, 0), np.maximum(index - low, 1)
    below = (sums[last] - sums[first]) / (last - first)
    background: Floats = np.maximum(np.maximum(level, below), 1e-12 * float(power.max()))
    return background


def _threshold(count: int) -> Floats:
    """The excess over its background that no bin of `count` reaches by chance.

    Power over a level that is estimated from few bins has the tail of an F distribution; at
    the ends of the spectrum the window holds half as many.
    """
    bins = np.full(count, _BACKGROUND_FREEDOM)
    half = _BACKGROUND_BINS // 2
    bins[:half] = bins[-half:] = _BACKGROUND_FREEDOM / 2
    threshold: Floats = bins * ((count / _FALSE_ALARM) ** (1 / bins) - 1)
    return threshold


def _refined(values: Floats, rate_hz: float, near_hz: float, density: float) -> Line:
    """The frequency of the largest power near a bin; errors by the Cramér-Rao bound."""
    duration_s = len(values) / rate_hz
    bin_hz = 1 / duration_s

    def cost(frequency_hz: float) -> float:
        return -_amplitude(values, frequency_hz, rate_hz)

    bounds = (near_hz - bin_hz, near_hz + bin_hz)
    frequency = float(optimize.minimize_scalar(cost, bounds=bounds, method="bounded").x)
    amplitude = _amplitude(values, frequency, rate_hz)
    amplitude_sd = float(np.sqrt(density / duration_s))
    share = amplitude_sd / amplitude if amplitude else 1.0
    frequency_sd = np.sqrt(3.0) * share / (np.pi * duration_s)
    return Line(frequency, _Z95 * float(frequency_sd), amplitude, _Z95 * amplitude_sd, rate_hz)


def _amplitude(values: Floats, frequency_hz: float, rate_hz: float) -> float:
    waves = _waves(frequency_hz, len(values), rate_hz)
    weights = _weights(waves, values)
    return float(np.hypot(*weights))
