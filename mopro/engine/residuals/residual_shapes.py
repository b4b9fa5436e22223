"""Shapes that a residual may have beyond white noise, each tested."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy import fft, special

from mopro.engine.assumed import (
    BUMP_BINS,
    CLEAR,
    FALSE_ALARMS,
    FEWEST,
    LEAST_SAMPLES,
    LEAST_SHARE,
    TOLERANCE,
)
from mopro.engine.residuals.noise_tests import (
    bartlett_log_p,
    chi2_log_p,
    cumulative_periodogram,
    cusum_step,
    is_still,
    line_log_p,
    normal_log_p,
)
from mopro.engine.residuals.whitened import Residuals, difference_variance
from mopro.engine.series import Floats, Series
from mopro.engine.spectrum import position_spectrum, sinusoid

# Standard deviations of the noise beyond which a sample is a wild one. Doubled, three wild samples
# at the end of a record are a step.
_WILD = -float(special.ndtri(FALSE_ALARMS / 2))


@dataclass(frozen=True)
class Finding:
    """Answer of one test: ln of its p-value, and the shape it looks for as a function of what.

    `general`: almost any shape fails the test, so that another one that fails says more.
    """

    log_p: float
    description: str | None
    variable: str | None = None
    general: bool = False


@dataclass(frozen=True)
class _Standardised:
    """Residual of one series, in standard deviations of its noise.

    Those are `scatter` times the stated or estimated ones.
    """

    series: Series
    z: Floats
    scatter: float = 1.0

    def label(self, name: str) -> Floats | None:
        label = self.series.labels.get(name)
        return None if label is None else np.asarray(label, dtype=float)

    def in_units(self, z: float) -> float:
        return z * (self.series.sigma or 1.0)


def shape_findings(residuals: Residuals, residual: Floats) -> list[Finding]:
    """The tests of a whitened residual (samples) for each shape, in each series and in all.

    Series of fewer than LEAST_SAMPLES are left out.
    """
    by_series = zip(residuals.data, residuals.split(residual), residuals.sigmas, strict=True)
    parts = [
        _standardised(series, own, sigma)
        for series, own, sigma in by_series
        if len(series) >= LEAST_SAMPLES
    ]
    findings = [finding for part in parts for finding in _own_shapes(part)]
    for _, group in groupby(sorted(parts, key=_sensor), key=_sensor):
        findings += _common_shapes(list(group))
    return findings


def _standardised(series: Series, residual: Floats, sigma: float) -> _Standardised:
    """In units of the stated noise, or of an upper limit of its estimate where that is more."""
    upper = 1 + CLEAR / math.sqrt(len(residual))
    scatter = upper * math.sqrt(difference_variance(residual)) or 1.0
    if series.sigma is not None:
        scatter = max(scatter, 1.0)
    return _Standardised(replace(series, sigma=sigma * scatter), residual / scatter, scatter)


def _sensor(part: _Standardised) -> str:
    return part.series.sensor


# -- in one series ---------------------------------------------------------------


def _own_shapes(part: _Standardised) -> Iterator[Finding]:
    yield _autocorrelation(part)
    if part.series.time_s is not None:
        yield _drift(part, part.series.time_s)
        yield _step(part, part.series.time_s)
    if _even(part.series):
        yield _line_in_time([part])


def _even(series: Series) -> bool:
    """True if the sampling rate is steady, so that the spectrum has frequencies."""
    if series.time_s is None:
        return False
    steps = np.diff(series.time_s)
    step = float(np.median(steps))
    # Single gaps do not matter.
    return float(np.quantile(np.abs(steps - step), 1 - LEAST_SHARE)) < TOLERANCE * step


def _autocorrelation(part: _Standardised) -> Finding:
    """Bartlett's test."""
    if is_still(part.z):
        return Finding(0.0, None)
    shares = cumulative_periodogram(part.z)
    return Finding(bartlett_log_p(shares), _wander(part, shares), "t")


def _wander(part: _Standardised, shares: Floats) -> str | None:
    """Description of power that gathers at low or high frequencies without being a line."""
    time_s = part.series.time_s
    if time_s is None:
        return None
    beyond = shares - np.linspace(0, 1, len(shares))
    edge = int(np.argmax(np.abs(beyond)))
    hertz = (edge + 1) / float(np.ptp(time_s))
    if beyond[edge] > 0:
        return f"a slow wander in time, below {hertz:.2g} Hz, in {part.series.run}"
    return f"a quick scatter in time, above {hertz:.2g} Hz, in {part.series.run}"


def _drift(part: _Standardised, time_s: Floats) -> Finding:
    """Slope of a straight line in time."""
    series, centred = part.series, time_s - time_s.mean()
    slope = float(centred @ part.z / (centred @ centred))
    strength = abs(slope) * math.sqrt(float(centred @ centred))
    total = part.in_units(slope) * float(np.ptp(time_s))
    words = f"a drift in time of {total:.3g} {series.unit} over {series.run}"
    return Finding(normal_log_p(strength), words, "t")


def _step(part: _Standardised, time_s: Floats) -> Finding:
    """The step in time between the two means that differ the most.

    There is none that a few wild samples alone make.
    """
    series, n = part.series, len(part.z)
    _, of_tame = cusum_step(np.clip(part.z, -_WILD, _WILD))
    if normal_log_p(of_tame, n) > math.log(FALSE_ALARMS):
        return Finding(0.0, None)
    last, contrast = cusum_step(part.z)
    height = part.in_units(-contrast * math.sqrt(n / ((last + 1) * (n - last - 1))))
    words = f"a step of {height:.3g} {series.unit} at {time_s[last]:.3g} s in {series.run}"
    return Finding(normal_log_p(contrast, n), words, "t")


# -- in all series of one sensor ---------------------------------------------------


def _common_shapes(parts: Sequence[_Standardised]) -> Iterator[Finding]:
    timed = [part for part in parts if _even(part.series)]
    if len(timed) > 1:
        yield _line_in_time(timed)
    clocked = [part for part in parts if part.series.time_s is not None]
    if clocked:
        yield _band(clocked)
    moving = [part for part in parts if _reach(part) > 0]
    if moving:
        yield _line_in_position(moving)
        yield _bump(moving)
    for name, shape in _LAWS.items():
        if all(part.label(shape[0]) is not None for part in parts):
            yield _law(parts, name, *shape)
    if all(part.label("velocity") is not None for part in parts):
        yield _scatter_of_speed(parts)


def _reach(part: _Standardised) -> float:
    """Range of the positions; 0 where they are not known."""
    position = part.label("position")
    return 0.0 if position is None else float(np.ptp(position))


def _line_in_time(parts: Sequence[_Standardised]) -> Finding:
    """The strongest line of the periodograms (even sampling), summed over the series."""
    length = fft.next_fast_len(max(len(part.z) for part in parts))
    powers = [np.abs(fft.rfft(part.z, length)[1:]) ** 2 / len(part.z) for part in parts]
    summed = np.sum(powers, axis=0)
    summed[: FEWEST - 1] = 0.0
    line = int(np.argmax(summed))
    series = parts[0].series
    assert series.time_s is not None, "only series with times are asked for lines in time"
    frequency = (line + 1) / (length * float(np.median(np.diff(series.time_s))))
    amplitude = 2 * math.sqrt(summed[line] / sum(len(part.z) for part in parts))
    where = series.run if len(parts) == 1 else "all runs"
    words = (
        f"a line at {frequency:.3g} Hz in time, "
        f"{parts[0].in_units(amplitude):.2g} {series.unit}, in {where}"
    )
    return Finding(line_log_p(float(summed[line]), len(summed), len(parts)), words, "t")


def _line_in_position(parts: Sequence[_Standardised]) -> Finding:
    """The strongest line of the periodograms over position, summed over the series."""
    positions = [np.asarray(part.label("position")) for part in parts]
    cycles, power = position_spectrum(
        positions, [part.z for part in parts], count=max(part.series.count for part in parts)
    )
    power[cycles * max(np.ptp(x) for x in positions) < FEWEST] = 0.0
    line = int(np.argmax(power))
    series = parts[0].series
    words = f"a line in position with a period of {1 / cycles[line]:.3g} {series.position_unit}"
    log_p = line_log_p(float(power[line]), len(cycles), len(parts))
    if (profile := _profile(parts, positions)).log_p < _sinusoid_log_p(
        parts, positions, cycles, line
    ):
        return replace(profile, log_p=log_p)
    return Finding(log_p, words, "x mod")


def _sinusoid_log_p(
    parts: Sequence[_Standardised], positions: Sequence[Floats], cycles: Floats, line: int
) -> float:
    """Test of the sinusoid of the line number `line`, the same in all runs."""
    angle = 2 * math.pi * cycles[line] * np.concatenate(positions)
    z = np.concatenate([part.z - part.z.mean() for part in parts])
    sine, cosine = sinusoid(angle, z)
    shape = sine * np.sin(angle) + cosine * np.cos(angle)
    left = z - (shape - shape.mean())
    return math.log(len(cycles)) + chi2_log_p(float(z @ z - left @ left), 2)


def _profile(parts: Sequence[_Standardised], positions: Sequence[Floats]) -> Finding:
    """The mean over all runs in each interval of position: any function of it."""
    position, z = np.concatenate(positions), np.concatenate([p.z - p.z.mean() for p in parts])
    low, reach = float(position.min()), float(np.ptp(position))
    best = Finding(0.0, None)
    for bins in BUMP_BINS:
        bin_of = np.minimum((bins * (position - low) / reach).astype(int), bins - 1)
        counts, sums = np.bincount(bin_of, minlength=bins), np.bincount(bin_of, z, bins)
        used = counts > 0
        total = float(np.sum(sums[used] ** 2 / counts[used]))
        log_p = math.log(len(BUMP_BINS)) + chi2_log_p(total, int(used.sum()) - 1)
        if log_p < best.log_p:
            size = parts[0].in_units(float(np.abs(sums[used] / counts[used]).max()))
            words = f"a function of position, up to {size:.2g} {parts[0].series.unit}"
            best = Finding(log_p, words, "x")
    return best


def _band(parts: Sequence[_Standardised]) -> Finding:
    """The band of frequencies, half an octave wide, with the clearest excess of power in all runs.

    Any shape that gathers there.
    """
    frequencies, powers = [], []
    for part in parts:
        assert part.series.time_s is not None, "only series with times are asked for bands"
        step = float(np.median(np.diff(part.series.time_s)))
        powers.append(fft.dct(part.z, norm="ortho")[1:] ** 2)
        frequencies.append(np.arange(1, len(part.z)) / (2 * len(part.z) * step))
    hertz, power = np.concatenate(frequencies), np.concatenate(powers)
    lowest = float(hertz.min())
    band_of = (2 * np.log2(hertz / lowest)).astype(int)
    width, summed = np.bincount(band_of), np.bincount(band_of, power)
    best = Finding(0.0, None)
    for band in np.flatnonzero(width):
        log_p = math.log(len(width)) + chi2_log_p(float(summed[band]), int(width[band]))
        if log_p < best.log_p:
            ends = " to ".join(f"{lowest * 2 ** (k / 2):.2g}" for k in (band, band + 1))
            words = f"more than noise in time at {ends} Hz"
            best = Finding(log_p, words, "t", general=True)
    return best


def _scatter_of_speed(parts: Sequence[_Standardised]) -> Finding:
    """Scatter from sample to sample that grows with the speed, as that of a clock does.

    Where a sensor at rest shows less than its noise, only what is beyond that counts; where it
    shows more, that is its noise.
    """
    whole, own, speeds = [], [], []
    for part in parts:
        v = np.asarray(part.label("velocity"))[1:]
        squares = np.diff(part.z) ** 2 / 2
        whole.append(squares * part.scatter**2)
        own.append(squares)
        speeds.append(v * v)
    speed = np.concatenate(speeds)
    strength = min(
        _strength(speed, np.concatenate(whole) - 1),
        _strength(speed - speed.mean(), np.concatenate(own) - 1),
    )
    words = "scatter that grows with the speed v"
    return Finding(normal_log_p(max(strength, 0.0)), words, "v")


def _strength(shape: Floats, squares: Floats) -> float:
    """Projection of `squares` on a shape, in standard deviations of those of white noise.

    Those of differences of neighbours have a variance of 2 and a covariance of 1/2 with the next.
    """
    norm = math.sqrt(3 * float(shape @ shape))
    return float(shape @ squares) / norm if norm else 0.0


def _bump(parts: Sequence[_Standardised]) -> Finding:
    """The interval of position whose mean is furthest from zero."""
    position = np.concatenate([np.asarray(part.label("position")) for part in parts])
    z = np.concatenate([part.z for part in parts])
    low, reach = float(position.min()), float(np.ptp(position))
    strength, middle, width, count, trials = 0.0, low, reach, 1.0, 0
    for bins in BUMP_BINS:
        bin_of = np.minimum((bins * (position - low) / reach).astype(int), bins - 1)
        counts, sums = np.bincount(bin_of, minlength=bins), np.bincount(bin_of, z, bins)
        means = sums / np.sqrt(np.maximum(counts, 1))
        largest = int(np.argmax(np.abs(means)))
        trials += int((counts > 0).sum())
        if abs(means[largest]) > abs(strength):
            strength, count = float(means[largest]), float(counts[largest])
            middle, width = low + (largest + 0.5) * reach / bins, reach / bins
    series = parts[0].series
    height = parts[0].in_units(strength / math.sqrt(count))
    words = (
        f"a local bump of {height:.2g} {series.unit} in position, at {middle:.3g} "
        f"{series.position_unit}, about {width:.2g} {series.position_unit} wide"
    )
    return Finding(normal_log_p(strength, trials), words, "x")


# description -> (label, function of it, variable)
_LAWS: dict[str, tuple[str, Callable[[Floats], Floats], str]] = {
    "a law in velocity v": ("velocity", lambda v: v, "v"),
    "a law in velocity v|v|": ("velocity", lambda v: v * np.abs(v), "v"),
    "the direction of motion sgn v": ("velocity", np.sign, "sgn v"),
    "a law in acceleration a": ("acceleration", lambda a: a, "a"),
    "a law in position x": ("position", lambda x: x, "x"),
    "a law in position x³": ("position", lambda x: (x - (x.max() + x.min()) / 2) ** 3, "x"),
}


def _law(
    parts: Sequence[_Standardised],
    name: str,
    label: str,
    shape: Callable[[Floats], Floats],
    variable: str,
) -> Finding:
    """Projection of the residual on a function of a label, its mean in each series taken out."""
    values = [shape(np.asarray(part.label(label))) for part in parts]
    centred = np.concatenate([v - v.mean() for v in values])
    z = np.concatenate([part.z for part in parts])
    norm = math.sqrt(float(centred @ centred))
    if not norm:
        return Finding(0.0, None)
    strength = float(centred @ z) / norm
    size = parts[0].in_units(abs(strength) * float(np.abs(centred).max()) / norm)
    words = f"{name}, up to {size:.2g} {parts[0].series.unit}"
    return Finding(normal_log_p(strength), words, variable)
