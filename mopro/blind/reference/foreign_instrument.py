"""Foreign faults of clock, signal, noise and storage of a sensor."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from mopro.blind.reference.foreign import Foreign
from mopro.blind.reference.motion import Floats

Generator = np.random.Generator


def clock(taken_s: Floats, foreign: Foreign | None, generator: Generator) -> Floats:
    """True times (s) of the samples, ascending.

    jittered_clock: `share` of the interval, uniform to either side, less than a half;
    stepping_clock: `step` (s) is skipped `every` seconds.
    """
    if foreign is None:
        return taken_s
    n = foreign.numbers
    if foreign.name == "jittered_clock":
        interval = float(taken_s[1] - taken_s[0])
        return taken_s + n["share"] * interval * generator.uniform(-1.0, 1.0, len(taken_s))
    if foreign.name == "stepping_clock":
        return taken_s + n["step"] * np.floor(np.maximum(taken_s, 0.0) / n["every"])
    return taken_s


def signal(
    seen: Floats, time_s: Floats, rise_K: Floats | None, foreign: Foreign | None, g: Generator
) -> Floats:
    """The reading (m) with a changed signal.

    wandering_gain: `rms` with the memory `tau` (s); thermal_bow: `bow` (m/K) at the distance
    `half` (m) from the start, in proportion to the forcer's `rise_K`.
    """
    if foreign is None:
        return seen
    n = foreign.numbers
    if foreign.name == "wandering_gain":
        memory = math.exp(-float(time_s[1] - time_s[0]) / n["tau"])
        return seen * (1 + n["rms"] * autoregressive(len(seen), memory, g))
    if foreign.name == "thermal_bow" and rise_K is not None:
        return seen + n["bow"] * rise_K * (seen / n["half"]) ** 2
    return seen


def noise(count: int, rms: float, foreign: Foreign | None, generator: Generator) -> Floats:
    """Noise of the stated size: white, or coloured for ar1_noise (`phi`) and flicker_noise."""
    if foreign is not None and foreign.name == "ar1_noise":
        return rms * autoregressive(count, foreign.numbers["phi"], generator)
    if foreign is not None and foreign.name == "flicker_noise":
        return rms * _flicker(count, generator)
    return generator.normal(0.0, rms, count)


def autoregressive(count: int, phi: float, generator: Generator) -> Floats:
    """Stationary noise of unit variance whose neighbours correlate by `phi`."""
    white = generator.standard_normal(count)
    first = white[0]
    driven = math.sqrt(1 - phi * phi) * white
    driven[0] = first
    return np.asarray(lfilter([1.0], [1.0, -phi], driven))


def _flicker(count: int, generator: Generator) -> Floats:
    """Noise of unit variance whose power falls as 1/f, down to one period of the record."""
    frequencies = np.arange(count // 2 + 1, dtype=np.float64)
    frequencies[0] = np.inf
    shape = frequencies**-0.5
    spectrum = shape * np.fft.rfft(generator.standard_normal(count))
    power = 2 * np.sum(shape[1:] ** 2) / count
    return np.asarray(np.fft.irfft(spectrum, count) / math.sqrt(power))


def stored_badly(
    reading: Floats, sigma: float, rate_hz: float, foreign: Foreign | None, g: Generator
) -> Floats:
    """The stored reading, in its unit.

    dropouts: zero for `lasts` seconds, `rate` times a second; outliers: `count` samples off by
    20 to 500 `sigma`; sticking_sensor: the last reading for `lasts` seconds, `rate` times a second.
    """
    if foreign is None or foreign.name not in ("dropouts", "outliers", "sticking_sensor"):
        return reading
    kept, n = reading.copy(), foreign.numbers
    if foreign.name == "outliers":
        at = g.choice(len(kept), int(n["count"]), replace=False)
        size = np.exp(g.uniform(math.log(20.0), math.log(500.0), len(at)))
        kept[at] += sigma * size * g.choice([-1.0, 1.0], len(at))
        return kept
    lasts = max(round(n["lasts"] * rate_hz), 2)
    times = max(round(n["rate"] * len(kept) / rate_hz), 1)
    for start in np.sort(g.integers(1, max(len(kept) - lasts, 2), times)):
        kept[start : start + lasts] = 0.0 if foreign.name == "dropouts" else kept[start - 1]
    return kept
