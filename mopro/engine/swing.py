"""Swing: a signal that follows another one as a mass on a spring does."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mopro.engine.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def _modal(time_s: Floats, signal: Floats, pole: complex) -> Floats:
    """Imaginary part of the state y of dy/dt = pole y + signal, which begins in equilibrium."""
    result = np.empty(len(signal))
    state = -signal[0] / pole
    result[0] = state.imag
    for i in range(1, len(signal)):
        step = pole * (time_s[i] - time_s[i - 1])
        if step != 0.0:
            # The exact answer to a signal that is linear between two samples.
            grown = np.exp(step)
            share = (grown - 1.0) / step
            slope = (share - 1.0) / step
            change = signal[i] - signal[i - 1]
            state = grown * state + (signal[i - 1] * share + change * slope) * step / pole
        result[i] = state.imag
    return result


def swing(time_s: Floats, signal: Floats, f_hz: float, zeta: float) -> Floats:
    """Answer q of an oscillator of natural frequency `f_hz` (Hz) and damping ratio `zeta` < 1.

    q'' + 2 zeta w q' + w² q = w² signal, with w = 2 pi f: q is the signal where that hardly
    changes within a period. Begins in equilibrium.
    """
    w = 2 * math.pi * f_hz
    ringing = w * math.sqrt(1 - zeta * zeta)
    found: Floats = _modal(time_s, signal, complex(-zeta * w, ringing))
    return w * w / ringing * found
