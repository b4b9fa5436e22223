"""Sensor models: geometry, transducer, lag, clock, mains hum, noise and converter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from mopro.blind.reference.motor import Floats, Generator, Hidden, of
from mopro.blind.reference.uncatalogued import Foreign, noise, stored_badly


@dataclass(frozen=True)
class Instrument:
    """A sensor; `unit` is the SI value of its column's unit, in which noise and ADC step are."""

    name: str
    quantity: str
    axis: int
    column: str
    unit: float
    rate_hz: float
    noise_rms: float
    adc_step: float

    @property
    def sigma(self) -> float:
        """Standard deviation of noise and rounding together, in the column's unit."""
        return math.hypot(self.noise_rms, self.adc_step / math.sqrt(12))


def sampled_at(stamps_s: Floats, hidden: Hidden) -> Floats:
    """True times (s) of the samples with these time stamps."""
    late = of(hidden, "trigger_delay", "t_d")
    return stamps_s * (1 + of(hidden, "sample_clock", "e")) - late


def transduced(x: Floats, other: Floats, rise_K: Floats | float, hidden: Hidden) -> Floats:
    """Reading (m) of a target at `x` (m) with the other axis at `other` (m); dense in time."""
    seen = x * (1 + of(hidden, "pitch_scale", "e"))
    if "platen_expansion" in hidden:
        grown = hidden["platen_expansion"]
        seen = seen * (1 + grown["alpha"] * (grown["dT"] + grown["share"] * rise_K))
    if "backlash" in hidden:
        seen = play(seen, hidden["backlash"]["B"])
    if "periodic_error" in hidden:
        wave = hidden["periodic_error"]
        angle = 2 * math.pi * seen / wave["lambda"] + wave["phi"]
        seen = seen + wave["A"] * np.sin(angle)
    seen = seen + of(hidden, "cross_axis_coupling", "gamma") * other
    seen = seen * (1 + of(hidden, "sensor_gain", "g"))
    seen = seen + of(hidden, "sensor_offset", "o")
    if "sensor_nonlinearity" in hidden:
        bent = hidden["sensor_nonlinearity"]
        u = (seen - bent["mid"]) / bent["half"]
        seen = seen + 2 * bent["half"] * u**3 * (bent["c3"] + bent["c5"] * u * u)
    return np.asarray(seen, dtype=np.float64)


@njit(cache=True)
def play(x, width):  # type: ignore[no-untyped-def]
    """Output of a play operator (backlash) of the given width (m), centred at the start."""
    seen = np.empty_like(x)
    at = x[0]
    for i in range(len(x)):
        if x[i] > at + width / 2:
            at = x[i] - width / 2
        elif x[i] < at - width / 2:
            at = x[i] + width / 2
        seen[i] = at
    return seen


@njit(cache=True)
def low_pass(x, step_s, lag_s):  # type: ignore[no-untyped-def]
    """First-order lag y + lag dy/dt = x, exact for x linear between samples `step_s` apart."""
    decay = math.exp(-step_s / lag_s)
    seen = np.empty_like(x)
    y = x[0]
    seen[0] = y
    for i in range(len(x) - 1):
        behind = (x[i + 1] - x[i]) / step_s * lag_s
        y = x[i + 1] - behind + (y - x[i] + behind) * decay
        seen[i + 1] = y
    return seen


def lag_s(quantity: str, hidden: Hidden) -> float:
    """Time constant (s) of the sensor's first-order lag; 0 for none."""
    if quantity == "temperature":
        return of(hidden, "thermocouple_lag", "tau")
    corner = of(hidden, "sensor_bandwidth", "f_c")
    return 1 / (2 * math.pi * corner) if corner else 0.0


def resampled(step_s: float, values: Floats, at_s: Floats) -> Floats:
    """Values sampled every `step_s` from time 0, interpolated by a cubic spline at other times.

    Before the start they are as at the start.
    """
    spline = CubicSpline(np.arange(len(values)) * step_s, values)
    return np.asarray(spline(np.clip(at_s, 0.0, (len(values) - 1) * step_s)), dtype=np.float64)


def with_hum(seen: Floats, taken_s: Floats, hidden: Hidden) -> Floats:
    """The reading with mains hum and its second and third harmonic."""
    if "hum" not in hidden:
        return seen
    hum = hidden["hum"]
    noisy = seen.copy()
    for n in ("", "2", "3"):
        angle = 2 * math.pi * int(n or 1) * hum["f"] * taken_s + hum[f"phi{n}"]
        noisy += hum[f"A{n}"] * np.sin(angle)
    return noisy


def stored(
    reading: Floats,
    instrument: Instrument,
    generator: Generator,
    foreign: Foreign | None = None,
) -> Floats:
    """The reading with noise added, rounded to steps of the converter; in the column's unit."""
    noisy = reading + noise(len(reading), instrument.noise_rms, foreign, generator)
    if instrument.adc_step:
        noisy = np.rint(noisy / instrument.adc_step) * instrument.adc_step
    kept = stored_badly(noisy, instrument.sigma, instrument.rate_hz, foreign, generator)
    return np.asarray(kept, dtype=np.float64)
