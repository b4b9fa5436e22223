"""The response of a first-order lag."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from scipy.linalg import blas

from mopro.plant.command_table import Floats


def first_order(interval_s: float, x: Floats, lag_s: float) -> Floats:
    """Response to evenly sampled `x` with the time constant `lag_s` (s), from rest at its start.

    y' = (x - y)/lag, exact for what is linear or a parabola over the samples.
    """
    decay = math.exp(-interval_s / lag_s)
    mean = lag_s / interval_s * (1 - decay)
    new, old = 1 - mean, mean - decay
    # What a parabola adds between two samples, for each unit of its second difference.
    bend = lag_s / interval_s * ((lag_s / interval_s + 0.5) * (1 - decay) - 1)
    second = np.pad(np.diff(x, 2), 1, "edge") if len(x) > 2 else np.zeros(len(x))
    means = np.concatenate(([0.0], (second[1:] + second[:-1]) / 2))
    driven = new * x + old * np.concatenate((x[:1], x[:-1])) + bend * means
    driven[0] = x[0]
    # Each value less `decay` times the one before is what drives it: a banded triangular system.
    # scipy.signal would solve it too, and takes a third of a second to import.
    bands = np.array([np.ones(len(x)), np.full(len(x), -decay)], order="F")
    return cast(Floats, blas.dtbsv(1, bands, driven, lower=1, diag=1, overwrite_x=1))
