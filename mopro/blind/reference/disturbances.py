"""Disturbances of a reading that no catalogue of effects has."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import cont2discrete, lfilter

from mopro.blind.reference.motion import Floats

NAMES = ("local_bump", "time_drift", "frame_sway", "random_walk")


def disturbance(
    name: str,
    numbers: Mapping[str, float],
    time_s: Floats,
    x: Floats,
    acceleration: Floats,
    generator: np.random.Generator,
) -> Floats:
    """The disturbance `name` over one series, shape (n,), dimensionless.

    local_bump: `at`, `width` (m); time_drift: `tau` (s); frame_sway: `f` (Hz), `zeta`;
    random_walk: none.
    """
    if name == "local_bump":
        return np.asarray(np.exp(-(((x - numbers["at"]) / numbers["width"]) ** 2) / 2))
    if name == "time_drift":
        return np.asarray(1 - np.exp(-time_s / numbers["tau"]))
    if name == "frame_sway":
        return _sway(time_s[1] - time_s[0], acceleration, numbers["f"], numbers["zeta"])
    return np.cumsum(generator.standard_normal(len(time_s)))


def _sway(step_s: float, acceleration: Floats, f_hz: float, zeta: float) -> Floats:
    """Displacement of an elastic frame under the motor's reaction force, per unit mass ratio."""
    w = 2 * math.pi * f_hz
    numerator, denominator, _ = cont2discrete(
        ([1.0], [1.0, 2 * zeta * w, w * w]), step_s, method="foh"
    )
    return np.asarray(lfilter(np.ravel(numerator), denominator, acceleration))
