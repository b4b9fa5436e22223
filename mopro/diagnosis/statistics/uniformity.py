"""Uniformity of an effect: whether it has the same size in all parts of the data.

What is missing has one size everywhere. An effect that merely resembles what is missing has, in
each part, the size that fits best there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from mopro.diagnosis.constants import FALSE_ALARMS, FEWEST, LEAST_SHARE, MAJORITY, ROUNDING
from mopro.diagnosis.fitting.fit import Fit
from mopro.diagnosis.fitting.residual import Residuals, projected_out
from mopro.diagnosis.model import Floats, Mask, Role
from mopro.diagnosis.statistics.noise import Noise


@dataclass(frozen=True)
class Spread:
    """Standard deviation of an effect's sizes among the parts beyond their errors, over its size.

    `significant`: Cochran's test finds that the parts differ. `of_remainder`: the share of the
    remaining sum of squares that a size for each part takes away.
    """

    share: float
    significant: bool
    of_remainder: float

    @property
    def of_a_stand_in(self) -> bool:
        """True if what it explains, or what remains, is mostly the effect at other sizes."""
        of_explained = self.share**2 / (1 + self.share**2)
        return self.significant and max(of_explained, self.of_remainder) > MAJORITY


def spread(
    residuals: Residuals, noise: Noise, masks: Sequence[Mask], fit: Fit, name: str
) -> Spread | None:
    """Spread of the size of the effect `name` of `fit` among the parts in `masks`.

    To first order: in each part the effect has a factor of its own, everything else adapts. The
    variance between the parts is that of DerSimonian and Laird (1986); its errors are those of
    noise like what then remains. None where fewer than three parts know the size.
    """
    own = np.array([n == name and p.role is Role.AMPLITUDE for n, p in fit.order], dtype=bool)
    away = fit.values - np.array([p.null for _, p in fit.order])
    change = fit.jacobian[:, own] @ away[own]
    information = np.array([float(change[mask] @ change[mask]) for mask in masks])
    seen = np.flatnonzero(information > LEAST_SHARE * information.mean())
    if len(seen) < FEWEST:
        return None
    parts = np.column_stack([np.where(masks[i], change, 0.0) for i in seen.tolist()])
    others, _ = np.linalg.qr(fit.jacobian[:, ~own])
    apart = projected_out(others, projected_out(residuals.basis, parts))
    inverse = np.linalg.pinv(apart.T @ apart, ROUNDING, hermitian=True)
    sizes = -inverse @ (apart.T @ fit.residual)
    left = fit.residual + apart @ sizes
    coloured = noise.like(left).transformed(apart @ inverse)
    deviation, significant = _between(sizes, coloured.T @ coloured)
    return Spread(deviation, significant, 1 - float(left @ left) / fit.rss)


def _between(sizes: Floats, covariance: Floats) -> tuple[float, bool]:
    """Standard deviation between `sizes` beyond their `covariance`, and if it is significant."""
    weights = 1 / np.diag(covariance)
    mean = float(weights @ sizes / weights.sum())
    q = float(weights @ (sizes - mean) ** 2)
    freedom = len(sizes) - 1
    variance = (q - freedom) / float(weights.sum() - weights @ weights / weights.sum())
    significant = q > float(special.chdtri(freedom, FALSE_ALARMS))
    return math.sqrt(max(variance, 0.0)), significant
