"""Lag: a signal that follows another one with a time constant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mopro.engine.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def _lag(time_s: Floats, signal: Floats, tau: float) -> Floats:
    result = signal.copy()
    for i in range(1, len(signal)):
        step = (time_s[i] - time_s[i - 1]) / tau
        if step == 0.0:  # beside a huge constant the time stands still
            result[i] = result[i - 1]
            continue
        # The exact answer to a signal that is linear between two samples.
        share = -math.expm1(-step)
        slope = (signal[i] - signal[i - 1]) / step
        result[i] = result[i - 1] + share * (signal[i - 1] - slope - result[i - 1])
        result[i] += signal[i] - signal[i - 1]
    return result


def lag(time_s: Floats, signal: Floats, tau: float) -> Floats:
    """A first-order lag of time constant `tau` (s); the signal itself at 0 or below."""
    found: Floats = _lag(time_s, signal, tau) if tau > 0 else signal
    return found
