"""The spectrum of noise: lines (hum), and a memory between neighbours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from mopro.noise.values import Floats

# -- lines ------------------------------------------------------------------------------------
# Spectral lines (hum) in stretches of noise: frequency, amplitude, interval.


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
    from scipy import signal  # brings SciPy's statistics, which take a third of a second

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
    from scipy import ndimage  # takes a tenth of a second

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


# -- memory -----------------------------------------------------------------------------------
# Memory of noise: a spectral model fitted by Whittle's likelihood.
#
# Three models compete by the Bayesian information criterion: white noise; a first-order
# autoregression AR(1); a white floor with a rise S = W (1 + (fc / f)^α) below a corner fc.
# Reference: P. Whittle (1953), Estimation and information in stationary time series.

Model = Callable[[Floats, Floats], Floats]

# Bins that a spectrum is joined to, narrower than any bend of the models. Doubled, a fit takes
# twice as long.
_MOST_BINS = 300
# Bins from which three parameters are fitted: four for each. Doubled, records of less than 49
# readings tell no memory, instead of 25.
_FEWEST_BINS = 12
# Bounds of the parameters that are not a level: lag-one correlation (a memory of a thousand
# readings: slower noise is a drift), exponent of the rise (1/f is 1, a random walk 2). Wider, fits
# of white noise end at a bound.
_MOST_CORRELATION = 0.999
_EXPONENTS = (0.3, 2.5)


@dataclass(frozen=True)
class Memory:
    """A fitted spectrum: `kind` white, ar1 or flicker, and its parameters.

    `correlation` is that of neighbouring readings with half its 95 % interval (ar1),
    `time_constant_s` its decay; `corner_hz` and `slope` (negative) describe a rise of the spectrum
    towards low frequencies (flicker). `white_rms` is the level of the flat part; the variance
    of white noise of this level is that density over the whole band. `inflation` is
    1 + 2 Σ ρ², by which the memory reduces the degrees of freedom of a variance.
    """

    kind: str
    white_rms: float
    inflation: float
    correlation: float = 0.0
    correlation_ci: float = 0.0
    time_constant_s: float = 0.0
    corner_hz: float = 0.0
    corner_ci_hz: tuple[float, float] = (0.0, 0.0)
    slope: float = 0.0
    slope_ci: float = 0.0


def memory_of(stretches: list[Floats], rate_hz: float) -> Memory | None:
    """The memory of stretches of readings at a fixed rate; None if they are too short."""
    frequencies, power, weights = _pooled(stretches, rate_hz)
    if len(power) < _FEWEST_BINS or not np.all(power > 0):
        return None
    half_band = rate_hz / 2
    x = frequencies / half_band
    fits = {kind: _fitted(kind, x, power, weights) for kind in ("white", "ar1", "flicker")}
    least = min(fits, key=lambda kind: fits[kind].criterion)
    fit = fits[least]
    white = float(np.sqrt(_floor(least, fit.parameters) * half_band))
    length = max(map(len, stretches))
    inflation = _inflation(_MODELS[least], fit.parameters, length)
    return _described(least, fit, white, inflation, rate_hz)


@dataclass(frozen=True)
class _Fit:
    parameters: Floats
    deviations: Floats
    criterion: float


def _pooled(stretches: list[Floats], rate_hz: float) -> tuple[Floats, Floats, Floats]:
    """Frequencies, mean density and number of ordinates in logarithmic bins of all stretches."""
    raw = [_periodogram(stretch, rate_hz) for stretch in stretches]
    frequencies = np.concatenate([f for f, _ in raw])
    power = np.concatenate([p for _, p in raw])
    order = np.argsort(frequencies)
    frequencies, power = frequencies[order], power[order]
    if len(power) <= _MOST_BINS:
        return frequencies, power, np.ones(len(power))
    edges = np.unique(np.rint(np.geomspace(1, len(power) + 1, _MOST_BINS)).astype(int) - 1)
    counts = np.diff(edges).astype(float)
    means = [np.add.reduceat(v, edges[:-1])[: len(counts)] / counts for v in (frequencies, power)]
    return means[0], means[1], counts


def _periodogram(values: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """One-sided density without the frequencies 0 and Nyquist."""
    count = len(values)
    transform = np.fft.rfft(values - values.mean())
    power = 2 * np.abs(transform) ** 2 / (count * rate_hz)
    inner = slice(1, (count + 1) // 2)
    return (np.arange(len(power)) * rate_hz / count)[inner], power[inner]


# -- models: frequency in half bands, logarithmic or bounded parameters -------------------


def _white(p: Floats, x: Floats) -> Floats:
    return np.full_like(x, np.exp(p[0]))


def _ar1(p: Floats, x: Floats) -> Floats:
    phi = _MOST_CORRELATION * np.tanh(p[1])
    spectrum: Floats = np.exp(p[0]) * (1 - phi**2) / (1 - 2 * phi * np.cos(np.pi * x) + phi**2)
    return spectrum


def _flicker(p: Floats, x: Floats) -> Floats:
    spectrum: Floats = np.exp(p[0]) * (1 + np.exp(p[2] * (p[1] - np.log(x))))
    return spectrum


_MODELS: dict[str, Model] = {"white": _white, "ar1": _ar1, "flicker": _flicker}
# Starts: the level is that of the mean density.
_STARTS: dict[str, list[list[float]]] = {
    "white": [[]],
    "ar1": [[0.1], [0.8], [1.8]],
    "flicker": [[np.log(0.02), 1.0], [np.log(0.1), 1.5], [np.log(0.3), 2.0]],
}


def _fitted(kind: str, x: Floats, power: Floats, weights: Floats) -> _Fit:
    model = _MODELS[kind]

    def cost(parameters: Floats) -> float:
        spectrum = model(parameters, x)
        return float(weights @ (np.log(spectrum) + power / spectrum))

    level = float(np.log(weights @ power / weights.sum()))
    bounds = {
        "white": [(level - 50, level + 50)],
        "ar1": [(level - 50, level + 50), (-3.0, 4.0)],
        "flicker": [(level - 50, level + 50), (np.log(x[0]) - 1, 0.5), _EXPONENTS],
    }[kind]
    low, high = np.transpose(bounds)
    starts = [np.clip([level, *start], low, high) for start in _STARTS[kind]]
    found = [
        optimize.minimize(cost, start, method="Nelder-Mead", bounds=bounds) for start in starts
    ]
    best = min(found, key=lambda result: float(result.fun))
    parameters = np.asarray(best.x, float)
    penalty = len(parameters) * np.log(weights.sum())
    deviations = _deviations(model, parameters, x, weights)
    return _Fit(parameters, deviations, 2 * float(best.fun) + float(penalty))


def _deviations(model: Model, parameters: Floats, x: Floats, weights: Floats) -> Floats:
    """Standard deviations of the parameters: Fisher's information of Whittle's likelihood."""
    small = 1e-4
    slopes = []
    for k in range(len(parameters)):
        moved = np.zeros(len(parameters))
        moved[k] = small
        up, down = model(parameters + moved, x), model(parameters - moved, x)
        slopes.append((np.log(up) - np.log(down)) / (2 * small))
    information = np.array([[float(weights @ (a * b)) for b in slopes] for a in slopes])
    deviations: Floats = np.sqrt(np.maximum(np.diag(np.linalg.pinv(information)), 0.0))
    return deviations


def _floor(kind: str, p: Floats) -> float:
    """Density of the flat part: that at the highest frequency for AR(1)."""
    return float(_ar1(p, np.ones(1))[0] if kind == "ar1" else np.exp(p[0]))


def _inflation(model: Model, parameters: Floats, length: int) -> float:
    """1 + 2 Σ ρ² of the model over stretches of this length, by Parseval's theorem."""
    count = min(max(length, 64), 1 << 16) // 2
    spectrum = model(parameters, (np.arange(count) + 1) / count)
    return float(np.mean(spectrum**2) / np.mean(spectrum) ** 2)


def _described(kind: str, fit: _Fit, white: float, inflation: float, rate_hz: float) -> Memory:
    if kind == "white":
        return Memory(kind, white, 1.0)
    half_band, (p, sd) = rate_hz / 2, (fit.parameters, fit.deviations)
    if kind == "ar1":
        phi = float(_MOST_CORRELATION * np.tanh(p[1]))
        half = _Z95 * float(sd[1] * _MOST_CORRELATION * (1 - np.tanh(p[1]) ** 2))
        constant = -1 / (rate_hz * np.log(phi)) if phi > 0 else 0.0
        return Memory(kind, white, inflation, phi, half, float(constant))
    corner = float(np.exp(p[1])) * half_band
    spread = float(np.exp(min(_Z95 * sd[1], 50.0)))
    return Memory(
        kind,
        white,
        inflation,
        corner_hz=corner,
        corner_ci_hz=(corner / spread, corner * spread),
        slope=-float(p[2]),
        slope_ci=_Z95 * float(sd[2]),
    )
