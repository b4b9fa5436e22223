"""Residuals without the offset of their sensor."""

from __future__ import annotations

import numpy as np

from mopro.experiment.model import Floats


def aligned(residual: Floats) -> Floats:
    """The residual without the sensor's offset.

    The offset is the mean of what lies near the median, so that a disagreement in a few
    places shows there and not everywhere.
    """
    middle = float(np.median(residual))
    spread = 1.4826 * float(np.median(np.abs(residual - middle)))
    near = np.abs(residual - middle) <= 3 * spread
    return residual - float(residual[near].mean())
