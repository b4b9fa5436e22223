"""The response of a first-order lag."""

from __future__ import annotations

import math

from scipy.signal import lfilter

from mopro.emulator.command import Floats


def first_order(interval_s: float, x: Floats, lag_s: float) -> Floats:
    """What follows evenly sampled `x` with the time constant `lag_s`, from rest at its start.

    y' = (x - y)/lag, exact for what is linear between the samples.
    """
    decay = math.exp(-interval_s / lag_s)
    mean = lag_s / interval_s * (1 - decay)
    new, old = 1 - mean, mean - decay
    filtered, _ = lfilter([new, old], [1, -decay], x, zi=[(old + decay) * float(x[0])])
    followed: Floats = filtered
    return followed
