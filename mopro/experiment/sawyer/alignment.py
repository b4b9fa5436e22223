"""Removes a sensor's offset from a residual."""

from __future__ import annotations

import numpy as np

from mopro.experiment.sawyer.model import Floats


def aligned(residual: Floats) -> Floats:
    """`residual` less its offset, a robust mean.

    The offset is the mean of the samples within 3 σ of the median, σ from the median absolute
    deviation, so that a disagreement in a few places does not shift all others.
    """
    middle = float(np.median(residual))
    spread = 1.4826 * float(np.median(np.abs(residual - middle)))
    near = np.abs(residual - middle) <= 3 * spread
    return residual - float(residual[near].mean())
