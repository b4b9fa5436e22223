"""Noise that residuals are judged by: in each series its size, and how many samples count.

Stated noise is white and of the stated size. What a model leaves of real data seldom is: it has
a memory, so that a thousand samples are as good as fifty independent ones, and nobody knows its
size beforehand. The likelihood is then that of as many independent samples, whose variance is
estimated and at least the stated one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import fft

from mopro.diagnosis.model import Floats, Mask
from mopro.diagnosis.residual import Residuals

# Share of its frequency that a band of the spectrum reaches to either side: a quarter. Doubled,
# a line is judged by what is further from it.
_BAND = 4
# Smallest variance, in place of 0, where a logarithm or a quotient is taken.
_TINY = 1e-300


@dataclass(frozen=True)
class Noise:
    """Size and memory of the noise in each series, in whitened units.

    `counts`: samples less nuisances. `effective`: independent samples among them, None where the
    noise is the stated one. `stated`: whether the series states its noise.
    """

    counts: tuple[int, ...]
    starts: tuple[int, ...]
    stated: tuple[bool, ...]
    effective: tuple[float, ...] | None = None

    @staticmethod
    def as_stated(residuals: Residuals) -> Noise:
        """White noise of the stated sizes; of unknown size where a series states none."""
        lengths = [len(series) for series in residuals.data]
        nuisances = [np.linalg.matrix_rank(series.nuisance_shapes()) for series in residuals.data]
        return Noise(
            tuple(max(n - int(k), 1) for n, k in zip(lengths, nuisances, strict=True)),
            tuple(np.cumsum([0, *lengths[:-1]]).tolist()),
            tuple(series.sigma is not None for series in residuals.data),
        )

    def like(self, residual: Floats) -> Noise:
        """Noise with the memory of `residual` (whitened samples), of a size to be estimated."""
        parts = np.split(residual, self.starts[1:])
        return replace(
            self,
            effective=tuple(
                min(effective_samples(part), n) for part, n in zip(parts, self.counts, strict=True)
            ),
        )

    @property
    def exact(self) -> bool:
        """True if the noise is white and of the stated sizes."""
        return self.effective is None

    def sums(self, residual: Floats) -> Floats:
        """Sum of squares of `residual` in each series."""
        return np.asarray(np.add.reduceat(residual**2, self.starts), dtype=float)

    def deviance(self, residual: Floats) -> float:
        """-2 ln likelihood of a whitened residual, up to a constant."""
        return float(self.deviance_of(self.sums(residual)))

    def deviance_of(self, sums: Floats) -> Floats:
        """The deviance at sums of squares (..., series).

        Of n independent samples with mean square m: n m for known variance 1, and
        n (ln v + m / v) for a variance v that is estimated, v = max(m, 1), or m where no size
        is stated.
        """
        mean = np.maximum(sums, 0.0) / self._counts
        variance = np.maximum(mean, self.floor)
        estimated = self.samples * (np.log(variance) + mean / variance)
        if not self.exact:
            return np.asarray(estimated.sum(axis=-1))
        return np.asarray(np.where(self._stated, sums, estimated).sum(axis=-1))

    def variances(self, residual: Floats) -> Floats:
        """Estimated variance of the noise at each sample, at least the stated one."""
        mean = np.where(
            self._stated if self.exact else False, 1.0, self.sums(residual) / self._counts
        )
        lengths = np.diff([*self.starts, len(residual)])
        return np.repeat(np.maximum(mean, self.floor), lengths)

    @cached_property
    def _counts(self) -> Floats:
        return np.array(self.counts, dtype=float)

    @cached_property
    def samples(self) -> Floats:
        """Independent samples in each series."""
        return self._counts if self.effective is None else np.array(self.effective)

    @cached_property
    def _stated(self) -> Mask:
        return np.array(self.stated)

    @cached_property
    def floor(self) -> Floats:
        """Least variance of the noise of each series."""
        return np.where(self._stated, 1.0, _TINY)


def effective_samples(values: Floats) -> float:
    """Number of independent samples that `values` are worth: their participation number.

    3 (Σ c²)² / Σ c⁴ over the coefficients c of the discrete cosine transform, which is n for
    white noise, and 3 for a single line. Unlike the integrated autocorrelation time it does not
    vanish for a residual that rings.
    """
    if len(values) < 2:
        return float(len(values))
    powers = fft.dct(values, norm="ortho") ** 2
    return float(min(len(values), 3 * powers.sum() ** 2 / max(float(powers @ powers), _TINY)))


def spectral_variance(jacobian: Floats, residual: Floats, noise: Noise) -> Floats:
    """Covariance of `jacobian`ᵀ z, for noise z with the spectrum of `residual`.

    Σ over series and frequencies of ĵ ĵᵀ S, ĵ being the cosine transform of the Jacobian
    (samples x parameters) and S that spectrum.
    """
    total = np.zeros((jacobian.shape[1],) * 2)
    for part, density, _ in _spectra(residual, noise):
        columns = fft.dct(jacobian[part], axis=0, norm="ortho")
        total += (columns * density[:, None]).T @ columns
    return total


def coloured_deviance(change: Floats, residual: Floats, noise: Noise) -> float:
    """Fall of the deviance by a `change` that was fitted, for noise with the residual's spectrum.

    (ν + 1) ln(1 + z²/ν), Student's, where z is the size of the change in standard errors, and
    ν the degrees of freedom from which the spectrum is known where the change has its power:
    against what wanders slowly, a slow change counts little, however many the samples.
    """
    size = own = spread = 0.0
    for part, density, freedom in _spectra(residual, noise):
        power = fft.dct(change[part], norm="ortho") ** 2
        size += float(power.sum())
        own += float(power @ density)
        spread += float((power * density) @ (power * density / freedom))
    if not size:
        return 0.0
    known_from = own**2 / max(spread, _TINY)
    z2 = size**2 / max(own, _TINY)
    return float((known_from + 1) * np.log1p(z2 / known_from))


def _spectra(residual: Floats, noise: Noise) -> Iterator[tuple[slice, Floats, Floats]]:
    """For each series its samples, the spectrum of its residual, and what that is known from.

    The mean of the squared cosine transform over a band of half an octave about each
    frequency, of three at least, and at least the stated noise; the number of frequencies in
    the band are its degrees of freedom.
    """
    for a, b, least in zip(
        noise.starts, [*noise.starts[1:], len(residual)], noise.floor, strict=True
    ):
        power = fft.dct(residual[a:b], norm="ortho") ** 2
        index = np.arange(b - a)
        half = np.maximum(index // _BAND, 1)
        low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, b - a)
        sums = np.concatenate([[0.0], np.cumsum(power)])
        width = (high - low).astype(float)
        yield slice(a, b), np.maximum((sums[high] - sums[low]) / width, least), width
