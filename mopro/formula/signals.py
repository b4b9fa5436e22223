"""Functions of a whole signal in time, sampled regularly or not: lag, delay, play, friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.engine.lag import lag
from mopro.engine.play import follow
from mopro.engine.swing import swing
from mopro.process.jit import njit

Floats = NDArray[np.float64]
# Compiled code is kept where numba keeps it.
_compiled: Callable[..., Any] = njit(cache=True, nogil=True)
# Share of the largest value beyond which a signal tells its side, unless another one is given.
_SIDE = 0.1


def delayed(time_s: Floats, signal: Floats, delay: float) -> Floats:
    """The signal `delay` (s) earlier, linear between samples; its first value before them."""
    return np.interp(time_s - delay, time_s, signal)


def play(time_s: Floats, signal: Floats, width: float, begun: float = 0.0) -> Floats:
    """The output of a play of full `width`.

    `begun`: the place in it at the beginning, from -1, taken up in the direction of the first
    motion, over 0, its middle, to 1.
    """
    moved = np.diff(signal)
    first_way = float(np.sign(moved[moved != 0][:1]).sum())
    return follow(signal, max(width, 0.0) / 2, begun * first_way)


@_compiled
def _presliding(signal: Floats, reach: float) -> Floats:
    result = np.zeros_like(signal)
    for i in range(1, len(signal)):
        moved = result[i - 1] + (signal[i] - signal[i - 1]) / reach
        result[i] = min(max(moved, -1.0), 1.0)
    return result


def presliding(time_s: Floats, signal: Floats, reach: float) -> Floats:
    """Dry friction as a share of its limit, -1 to 1: it follows the signal until it slides.

    `reach` is the change of the signal from the middle to sliding.
    """
    found: Floats = _presliding(signal, max(reach, 1e-300))
    return found


def side(time_s: Floats, signal: Floats, share: float = _SIDE) -> Floats:
    """The side (-1 or 1) on which the signal last was, by more than a share of its largest value.

    0 before that.
    """
    strong = np.where(np.abs(signal) > share * np.max(np.abs(signal), initial=0.0), 1, 0)
    last = np.maximum.accumulate(np.where(strong, np.arange(len(signal)), -1))
    return np.where(last >= 0, np.sign(signal)[last], 0.0)


def swung(time_s: Floats, signal: Floats, f_hz: float, zeta: float) -> Floats:
    """Response of a mass on a spring to the signal (n), of natural frequency `f_hz` (Hz).

    NaN unless `f_hz` > 0 and the damping ratio 0 <= `zeta` < 1.
    """
    if f_hz > 0 and 0 <= zeta < 1:
        return swing(time_s, signal, f_hz, zeta)
    return np.full_like(signal, np.nan)


def before(time_s: Floats, signal: Floats) -> Floats:
    """The sum of all earlier samples; samples that are not there (NaN) count nothing."""
    known = np.nan_to_num(signal)
    return np.cumsum(known) - known


def since_change(time_s: Floats, signal: Floats) -> Floats:
    """Time (s) since the signal last changed, or since the beginning."""
    changed = np.concatenate([[True], np.diff(signal) != 0])
    return time_s - np.maximum.accumulate(np.where(changed, time_s, time_s[0]))


def rate(time_s: Floats, signal: Floats) -> Floats:
    """The derivative in time (1/s), by central differences."""
    return np.gradient(signal, time_s) if len(signal) > 1 else np.zeros_like(signal)


def first(time_s: Floats, signal: Floats) -> Floats:
    """The first value of the signal, at all times."""
    return np.full_like(signal, signal[0])


SIGNALS: dict[str, Callable[..., Floats]] = {
    "lag": lag, "delayed": delayed, "play": play, "presliding": presliding, "side": side,
    "swing": swung,
    "before": before, "since_change": since_change, "rate": rate, "first": first,
}  # fmt: skip


# -- a signal that holds each value up to the next one -----------------------------------

# Share of a time constant below which an interval of samples is told by its leading term, to within
# 5e-5 of the first moment. Doubled, to 1e-4; at a tenth of it rounding is more than the moment.
_SHORT = 1e-4


def held_delayed(time_s: Floats, signal: Floats, delay: float) -> tuple[Floats, Floats]:
    """A held signal `delay` (s) earlier, which steps between samples, as lines between them.

    Beginning and end of the line from each sample to the next that has the mean and the first
    moment of what is there: a mass that it pushes has the right speed and place at each sample.
    """
    # Integrals of the signal and of that integral, up to each sample.
    step_s = np.diff(time_s)
    once = np.append(0.0, np.cumsum(signal[:-1] * step_s))
    twice = np.append(0.0, np.cumsum(once[:-1] * step_s + signal[:-1] * step_s**2 / 2))
    at = time_s - delay
    before = np.clip(np.searchsorted(time_s, at, side="right") - 1, 0, len(signal) - 1)
    since = at - time_s[before]
    integral = once[before] + signal[before] * since
    double = twice[before] + once[before] * since + signal[before] * since**2 / 2
    mean = np.diff(integral) / step_s
    moment = step_s / 2 * (integral[1:] + integral[:-1]) - np.diff(double)
    return _lines(signal, mean, 12 * moment / step_s**2)


def held_lag(time_s: Floats, signal: Floats, tau: float) -> tuple[Floats, Floats]:
    """A held signal behind a first-order lag of `tau` (s), as lines between samples.

    As `held_delayed`.
    """
    if tau <= 0:
        return signal, signal
    share = np.diff(time_s) / tau
    away = _decaying(signal, np.exp(-share))
    long = np.where(share > _SHORT, share, 1.0)
    mean = np.where(share > _SHORT, -np.expm1(-long) / long, 1 - share / 2)
    moment = (1 - np.exp(-long) * (1 + long)) / long**2 - mean / 2
    moment = np.where(share > _SHORT, moment, -share / 12)
    return _lines(signal, signal[:-1] + away[:-1] * mean, 12 * away[:-1] * moment)


@_compiled
def _decaying(signal: Floats, kept: Floats) -> Floats:
    """Lag less signal at each sample, of which a share `kept` (samples - 1) is left at the next."""
    away = np.zeros_like(signal)
    for i in range(1, len(signal)):
        away[i] = away[i - 1] * kept[i - 1] + signal[i - 1] - signal[i]
    return away


def _lines(signal: Floats, mean: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """Beginnings and ends; behind the last sample the signal itself."""
    return np.append(mean - slope / 2, signal[-1]), np.append(mean + slope / 2, signal[-1])


def _of_held(end: int) -> dict[str, Callable[..., Floats]]:
    return {
        **SIGNALS,
        "delayed": lambda *args: held_delayed(*args)[end],
        "lag": lambda *args: held_lag(*args)[end],
    }


# The functions at the beginning and at the end of what a held signal is up to the next sample.
BEGINNINGS, ENDS = _of_held(0), _of_held(1)
