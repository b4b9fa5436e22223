"""Uniformity of an effect: whether it has the same size in all parts of the data.

What is missing has one size everywhere. An effect that merely resembles what is missing has, in
each part, the size that fits best there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mopro.engine.assumed import (
    FALSE_ALARMS,
    FEWEST,
    LEAST_SHARE,
    LINEARITY_ERROR,
    MAJORITY,
    ROUNDING,
    TINY,
)
from mopro.engine.candidate import Role
from mopro.engine.fits.fit import Fit
from mopro.engine.residuals import Noise, Residuals, projected_out
from mopro.engine.series import Floats, Mask


@dataclass(frozen=True)
class Spread:
    """Standard deviation of an effect's sizes among the parts beyond their errors, over its size.

    `significant`: Cochran's test finds that the parts differ. `of_remainder`: the share of what
    remains beyond the noise that a size for each part takes away, beside an offset for each.
    """

    share: float
    significant: bool
    of_remainder: float

    @property
    def of_a_stand_in(self) -> bool:
        """True if what it explains, or what remains, is mostly the effect at other sizes.

        Sizes that differ by no more than the error of a linear approximation are one size.
        """
        of_explained = self.share**2 / (1 + self.share**2)
        mostly = max(of_explained, self.of_remainder) > MAJORITY
        return self.significant and mostly and self.share > LINEARITY_ERROR


def spread(
    residuals: Residuals,
    noise: Noise,
    masks: Sequence[Mask],
    fit: Fit,
    name: str,
    unexplained: float,
) -> Spread | None:
    """Spread of the size of the effect `name` of `fit` among the parts in `masks`.

    To first order: in each part the effect has a factor of its own, each series an offset of its
    own, and all else adapts. What is slow is the offsets', as sizes that differ from part to part
    fit anything slow. The variance between the parts is that of DerSimonian and Laird (1986), for
    sizes whose errors are correlated; the errors are those of noise like what then remains.
    `unexplained`: what `fit` leaves beyond noise (chi-squared), 0 if it leaves noise. None where
    fewer than three parts know the size.
    """
    offsets = _offsets(residuals, masks)
    own = np.array([n == name and p.role is Role.AMPLITUDE for n, p in fit.order], dtype=bool)
    change = -fit.linear_part(name)
    parts = _less_means(np.column_stack([np.where(mask, change, 0.0) for mask in masks]), offsets)
    information = np.sum(parts**2, axis=0)
    seen = information > LEAST_SHARE * information.mean()
    if seen.sum() < FEWEST:
        return None
    adapting = np.hstack([fit.jacobian[:, ~own], residuals.basis])
    centred = _less_means(adapting, offsets)
    whole, left = (np.linalg.norm(columns, axis=0) for columns in (adapting, centred))
    # A constant is the offsets', and has no direction of its own.
    others, _ = np.linalg.qr(centred[:, left > ROUNDING * whole])
    apart = projected_out(others, parts[:, seen])
    before = projected_out(others, _less_means(fit.residual[:, None], offsets)[:, 0])
    inverse = np.linalg.pinv(apart.T @ apart, ROUNDING, hermitian=True)
    sizes = -inverse @ (apart.T @ before)
    after = before + apart @ sizes
    coloured = noise.like(after).transformed(apart @ inverse)
    deviation, significant = _between(sizes, coloured.T @ coloured)
    fall = float(before @ before - after @ after)
    return Spread(deviation, significant, fall / unexplained if unexplained > 0 else 0.0)


def _offsets(residuals: Residuals, masks: Sequence[Mask]) -> NDArray[np.intp]:
    """Number (samples) of the offset of each series in each part."""
    series = np.repeat(np.arange(len(residuals.data)), [len(s) for s in residuals.data])
    part = np.argmax(masks, axis=0)
    return np.asarray(np.unique(part * len(residuals.data) + series, return_inverse=True)[1])


def _less_means(columns: Floats, offsets: NDArray[np.intp]) -> Floats:
    """`columns` (samples x any) less their mean over each of the `offsets`."""
    left = np.empty_like(columns)
    counts = np.bincount(offsets)
    for i, column in enumerate(columns.T):
        left[:, i] = column - (np.bincount(offsets, column) / counts)[offsets]
    return left


def _between(sizes: Floats, covariance: Floats) -> tuple[float, bool]:
    """Standard deviation between `sizes` beyond their `covariance`, and if it is significant."""
    weights = np.linalg.pinv(covariance, ROUNDING, hermitian=True)
    away = sizes - float(np.sum(weights @ sizes) / weights.sum())
    q = float(away @ weights @ away)
    freedom = len(sizes) - 1
    expected = float(np.trace(weights) - np.sum(weights @ weights) / weights.sum())
    significant = q > float(special.chdtri(freedom, FALSE_ALARMS))
    return math.sqrt(max(q - freedom, 0.0) / max(expected, TINY)), significant
