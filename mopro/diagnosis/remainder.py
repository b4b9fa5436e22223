"""What is left when the effects are taken out: whether it is noise, and what it looks like."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy import fft, stats

from mopro.diagnosis.model import Floats, Series
from mopro.diagnosis.residual import Residuals, white_variance
from mopro.diagnosis.spectrum import position_spectrum

# A false alarm in one of a thousand remainders that are noise, over all tests together.
FALSE_ALARMS = 1e-3
# Nobody knows a sensor's noise better than this; what is white and no larger is noise.
NOISE_TOLERANCE = 0.05
_FEWEST = 60
# How far off what the data themselves say of their noise may be, in its standard errors.
_ERRORS = 2.0
# Fewer cycles than these in all the data are no line, but a bend.
_FEWEST_CYCLES = 4
# Kolmogorov's chance is its first term beyond this.
_FAR = 3.0
_BINS = (8, 16, 32, 64)
# What varies less than this, in the noise's variance, does not vary: a sensor at rest.
STILL = 1e-6
# Times whose steps are nearly all alike are even; a gap here and there is none too many.
_ALIKE, _NEARLY_ALL = 0.01, 0.9


@dataclass(frozen=True)
class Remainder:
    """Whether what is left is more than noise, and the most telling shape in it.

    `scatter` is its root mean square in standard deviations of the sensors' noise, 1 where
    that is not known.
    """

    significant: bool
    description: str | None
    p_value: float
    scatter: float = 1.0


@dataclass(frozen=True)
class _Finding:
    """A test's answer: the logarithm of how often noise does as much, and words for it."""

    log_p: float
    description: str | None


@dataclass(frozen=True)
class _Left:
    """What is left of one series, in standard deviations."""

    series: Series
    z: Floats

    def label(self, name: str) -> Floats | None:
        label = self.series.labels.get(name)
        return None if label is None else np.asarray(label, dtype=float)


def examine(residuals: Residuals, residual: Floats, parameters: int) -> Remainder:
    """Test what `residual` leaves, to which `parameters` numbers were fitted.

    Of a series with unknown noise only the shape can be tested, against as much white
    noise.
    """
    parts = zip(residuals.data, residuals.split(residual), residuals.sigmas, strict=True)
    lefts = [_left(series, own, sigma) for series, own, sigma in parts if len(series) >= _FEWEST]
    known = residuals.known
    tests = [_excess(residual, parameters)] if known else []
    tests += [test for left in lefts for test in _own_shapes(left)]
    for _, group in groupby(sorted(lefts, key=_sensor), key=_sensor):
        tests += _common_shapes(list(group))
    if not tests:
        return Remainder(False, None, 1.0)
    scatter = math.sqrt(float(np.mean(residual**2))) if known else 1.0
    log_p = min(test.log_p for test in tests) + math.log(len(tests))
    p_value = math.exp(min(log_p, 0.0))
    if p_value >= FALSE_ALARMS:
        return Remainder(False, None, p_value, scatter)
    return Remainder(True, _words(tests, scatter), p_value, scatter)


def _left(series: Series, own: Floats, sigma: float) -> _Left:
    """Where nobody knows the noise, neighbouring samples tell it, with an error of their own."""
    if series.sigma is not None:
        return _Left(series, own)
    known = 1 + _ERRORS / math.sqrt(len(own))
    scatter = known * math.sqrt(white_variance(own)) or 1.0
    return _Left(replace(series, sigma=sigma * scatter), own / scatter)


def _words(tests: Sequence[_Finding], scatter: float) -> str:
    described = [test for test in tests if test.description]
    telling = min(described, key=lambda test: test.log_p, default=None)
    level = math.log(FALSE_ALARMS / len(tests))
    if telling and telling.description and telling.log_p < level:
        return telling.description
    return f"more scatter than the sensor's noise, {scatter:.3g} times as much"


def _sensor(left: _Left) -> str:
    return left.series.sensor


def _excess(residual: Floats, parameters: int) -> _Finding:
    freedom = max(len(residual) - parameters, 1)
    allowed = (1 + NOISE_TOLERANCE) ** 2
    return _Finding(float(stats.chi2.logsf(residual @ residual / allowed, freedom)), None)


# -- in one series ---------------------------------------------------------------


def _own_shapes(left: _Left) -> Iterator[_Finding]:
    series, z = left.series, left.z
    yield _memory(left)
    if series.time_s is not None:
        yield _drift(series, series.time_s, z)
        yield _step(series, series.time_s, z)
    if _even(series):
        yield _line_in_time([left])


def _even(series: Series) -> bool:
    """Whether it was sampled at a steady rate: a place in its spectrum is a frequency then."""
    if series.time_s is None:
        return False
    steps = np.diff(series.time_s)
    step = float(np.median(steps))
    return float(np.mean(np.abs(steps - step) < _ALIKE * step)) >= _NEARLY_ALL


def _memory(left: _Left) -> _Finding:
    """Bartlett's test (1955): the cumulative periodogram of white noise is a straight line."""
    z = left.z
    if float(np.var(z)) < STILL:
        return _Finding(0.0, None)
    shares = cumulative_periodogram(z)
    distance = float(stats.kstest(shares, "uniform", method="asymp").statistic)
    return _Finding(_kolmogorov(distance * math.sqrt(len(shares))), _wander(left, shares))


def cumulative_periodogram(z: Floats) -> Floats:
    """The share of the variance at each frequency and below, the last (1) left out."""
    power = np.abs(fft.rfft(z - z.mean()))[1 : (len(z) + 1) // 2] ** 2
    shares: Floats = np.cumsum(power)[:-1] / float(power.sum())
    return shares


def _kolmogorov(distance: float) -> float:
    """The log of Kolmogorov's limiting chance, by its first term where that is all of it."""
    if distance > _FAR:
        return math.log(2) - 2 * distance**2
    return float(stats.kstwobign.logsf(distance))


def _wander(left: _Left, shares: Floats) -> str | None:
    """Words for power that gathers at low or high frequencies, without being a line there."""
    time_s = left.series.time_s
    if time_s is None:
        return None
    beyond = shares - np.linspace(0, 1, len(shares))
    edge = int(np.argmax(np.abs(beyond)))
    hertz = (edge + 1) / float(np.ptp(time_s))
    if beyond[edge] > 0:
        return f"a slow wander in time, below {hertz:.2g} Hz, in {left.series.run}"
    return f"a quick scatter in time, above {hertz:.2g} Hz, in {left.series.run}"


def _drift(series: Series, time_s: Floats, z: Floats) -> _Finding:
    centred = time_s - time_s.mean()
    slope = float(centred @ z / (centred @ centred))
    strength = abs(slope) * math.sqrt(float(centred @ centred))
    total = slope * (series.sigma or 1.0) * float(np.ptp(time_s))
    words = f"a drift in time of {total:.3g} {series.unit} over {series.run}"
    return _Finding(_two_sided(strength), words)


def _step(series: Series, time_s: Floats, z: Floats) -> _Finding:
    """The place where the means before and after differ the most."""
    n = len(z)
    before = np.arange(1, n)
    contrast = np.cumsum(z - z.mean())[:-1] / np.sqrt(before * (n - before) / n)
    at = int(np.argmax(np.abs(contrast)))
    height = -contrast[at] * math.sqrt(n / ((at + 1) * (n - at - 1))) * (series.sigma or 1.0)
    words = f"a step of {height:.3g} {series.unit} at {time_s[at]:.3g} s in {series.run}"
    return _Finding(_two_sided(float(contrast[at]), n), words)


# -- in all series of one sensor ---------------------------------------------------


def _common_shapes(lefts: Sequence[_Left]) -> Iterator[_Finding]:
    timed = [left for left in lefts if _even(left.series)]
    if len(timed) > 1:
        yield _line_in_time(timed)
    placed = [left for left in lefts if _reach(left) > 0]
    if placed:
        yield _line_in_position(placed)
        yield _bump(placed)
    for name, shape in _LAWS.items():
        if all(left.label(shape[0]) is not None for left in lefts):
            yield _law(lefts, name, *shape)


def _reach(left: _Left) -> float:
    position = left.label("position")
    return 0.0 if position is None else float(np.ptp(position))


def _line_in_time(lefts: Sequence[_Left]) -> _Finding:
    """The strongest line of the periodograms (evenly sampled), summed over the runs."""
    length = fft.next_fast_len(max(len(left.z) for left in lefts))
    powers = [np.abs(fft.rfft(left.z, length)[1:]) ** 2 / len(left.z) for left in lefts]
    summed = np.sum(powers, axis=0)
    summed[: _FEWEST_CYCLES - 1] = 0.0
    at = int(np.argmax(summed))
    times = lefts[0].series.time_s
    assert times is not None, "only series with times are asked for lines in time"
    frequency = (at + 1) / (length * float(np.median(np.diff(times))))
    amplitude = 2 * math.sqrt(summed[at] / sum(len(left.z) for left in lefts))
    series = lefts[0].series
    where = series.run if len(lefts) == 1 else "all runs"
    words = (
        f"a line at {frequency:.3g} Hz in time, "
        f"{amplitude * (series.sigma or 1.0):.2g} {series.unit}, in {where}"
    )
    return _Finding(_line_chance(float(summed[at]), len(summed), len(lefts)), words)


def _line_in_position(lefts: Sequence[_Left]) -> _Finding:
    positions = [np.asarray(left.label("position")) for left in lefts]
    cycles, power = position_spectrum(positions, [left.z for left in lefts])
    power[cycles * max(np.ptp(x) for x in positions) < _FEWEST_CYCLES] = 0.0
    at = int(np.argmax(power))
    series = lefts[0].series
    words = f"a line in position with a period of {1 / cycles[at]:.3g} {series.position_unit}"
    return _Finding(_line_chance(float(power[at]), len(cycles), len(lefts)), words)


def _line_chance(power: float, lines: int, runs: int) -> float:
    """How often (log) the strongest of `lines` summed lines of unit white noise is as strong."""
    return min(0.0, math.log(lines) + float(stats.gamma.logsf(power, runs)))


def _two_sided(strength: float, chances: int = 1) -> float:
    """How often (log) the largest of `chances` standard normals is as far from 0."""
    return min(0.0, math.log(2 * chances) + float(stats.norm.logsf(abs(strength))))


def _bump(lefts: Sequence[_Left]) -> _Finding:
    """The stretch of the way whose mean is furthest off."""
    position = np.concatenate([np.asarray(left.label("position")) for left in lefts])
    z = np.concatenate([left.z for left in lefts])
    low, reach = float(position.min()), float(np.ptp(position))
    best, chances = (0.0, 0.0, 0.0, 1.0), 0
    for bins in _BINS:
        place = np.minimum((bins * (position - low) / reach).astype(int), bins - 1)
        counts, sums = np.bincount(place, minlength=bins), np.bincount(place, z, bins)
        means = sums / np.sqrt(np.maximum(counts, 1))
        at = int(np.argmax(np.abs(means)))
        chances += int((counts > 0).sum())
        if abs(means[at]) > abs(best[0]):
            best = (float(means[at]), at, bins, float(counts[at]))
    strength, at_bin, of_bins, count = best
    series = lefts[0].series
    height = strength / math.sqrt(count) * (series.sigma or 1.0)
    middle, width = low + (at_bin + 0.5) * reach / max(of_bins, 1), reach / max(of_bins, 1)
    words = (
        f"a local bump of {height:.2g} {series.unit} in position, at {middle:.3g} "
        f"{series.position_unit}, about {width:.2g} {series.position_unit} wide"
    )
    return _Finding(_two_sided(strength, chances), words)


# words -> (label, what is taken of it)
_LAWS: dict[str, tuple[str, Callable[[Floats], Floats]]] = {
    "a law in velocity v": ("velocity", lambda v: v),
    "a law in velocity v|v|": ("velocity", lambda v: v * np.abs(v)),
    "the direction of motion sgn v": ("velocity", np.sign),
    "a law in acceleration a": ("acceleration", lambda a: a),
    "a law in position x": ("position", lambda x: x),
    "a law in position x³": ("position", lambda x: (x - (x.max() + x.min()) / 2) ** 3),
}


def _law(
    lefts: Sequence[_Left], name: str, label: str, shape: Callable[[Floats], Floats]
) -> _Finding:
    values = [shape(np.asarray(left.label(label))) for left in lefts]
    parts = np.concatenate([v - v.mean() for v in values])
    z = np.concatenate([left.z for left in lefts])
    strength = math.sqrt(float(parts @ parts))
    if not strength:
        return _Finding(0.0, None)
    slope = float(parts @ z) / strength
    series = lefts[0].series
    size = abs(slope) * float(np.abs(parts).max()) / strength * (series.sigma or 1.0)
    words = f"{name}, up to {size:.2g} {series.unit}"
    return _Finding(_two_sided(slope), words)
