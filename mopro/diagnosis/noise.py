"""Noise that residuals are judged by: in each series its size, spectrum and independent samples.

Stated noise is white and of the stated size. What a model leaves of real data seldom is: it has
a memory, so that a thousand samples are as good as fifty independent ones, and nobody knows its
size beforehand. Its spectrum is then taken from what the fullest set of effects leaves.
"""

from __future__ import annotations

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
    """Size and spectrum of the noise in each series, in whitened units.

    `counts`: samples less nuisances. `starts`: the first sample of each. `stated`: whether the
    series states its noise. `remainder`: the residual (samples) whose spectrum the noise has,
    None where the noise is white and of the stated size.
    """

    counts: tuple[int, ...]
    starts: tuple[int, ...]
    stated: tuple[bool, ...]
    remainder: Floats | None = None

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

    def like(self, remainder: Floats) -> Noise:
        """Noise with the size and spectrum of `remainder`."""
        return replace(self, remainder=remainder)

    @property
    def exact(self) -> bool:
        """True if the noise is white and of the stated sizes."""
        return self.remainder is None

    def sums(self, residual: Floats) -> Floats:
        """Sum of squares of `residual` in each series."""
        return np.asarray(np.add.reduceat(residual**2, self.starts), dtype=float)

    def deviance(self, residual: Floats) -> float:
        """-2 ln likelihood of a whitened residual, up to a constant.

        Where the noise is not the stated one, that of the excess over the `remainder`: see
        `of_excess`.
        """
        if self.remainder is None:
            return self.of_sums(self.sums(residual))
        change = residual - self.remainder
        excess = float(residual @ residual - self.remainder @ self.remainder)
        return self.of_excess(excess, *self.in_spectrum(change))

    def of_sums(self, sums: Floats) -> float:
        """The deviance at a sum of squares of each series, for white noise.

        The sum itself for variance 1; n ln(sum / n) where the size is not stated.
        """
        estimated = self._counts * np.log(np.maximum(sums, _TINY) / self._counts)
        return float(np.where(self._stated, sums, estimated).sum())

    @staticmethod
    def of_excess(excess: float, density: float, freedom: float) -> float:
        """Deviance of an `excess` (sum of squares) where the noise has a power of `density`.

        (ν + 1) ln(1 + excess / (S ν)), Student's, with the density S known from ν degrees of
        freedom: against what wanders slowly, a slow change counts little, however many the
        samples.
        """
        return float((freedom + 1) * np.log1p(max(excess, 0.0) / (density * freedom)))

    def in_spectrum(self, change: Floats) -> tuple[float, float]:
        """Mean power density of the noise where `change` has its power; its degrees of freedom."""
        size = own = spread = 0.0
        for part, density, freedom in self.spectra:
            power = fft.dct(change[part], norm="ortho") ** 2
            size += float(power.sum())
            own += float(power @ density)
            spread += float((power * density) @ (power * density / freedom))
        if not own:
            return 1.0, 1.0
        return own / size, own**2 / max(spread, _TINY)

    @cached_property
    def spectra(self) -> list[tuple[slice, Floats, Floats]]:
        """For each series its samples, the spectrum of the remainder, and its degrees of freedom.

        The mean of the squared cosine transform over a band of half an octave about each
        frequency, of three at least, and at least the stated noise. The number of frequencies
        in the band are its degrees of freedom.
        """
        assert self.remainder is not None, "stated noise is white"
        ends = [*self.starts[1:], len(self.remainder)]
        answer = []
        for a, b, least in zip(self.starts, ends, self.floor.tolist(), strict=True):
            power = fft.dct(self.remainder[a:b], norm="ortho") ** 2
            index = np.arange(b - a)
            half = np.maximum(index // _BAND, 1)
            low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, b - a)
            sums = np.concatenate([[0.0], np.cumsum(power)])
            width = (high - low).astype(float)
            density = np.maximum((sums[high] - sums[low]) / width, least)
            answer.append((slice(a, b), density, width))
        return answer

    def transformed(self, columns: Floats) -> Floats:
        """Cosine transform of `columns` (samples x any), times the root of the density."""
        parts = [
            fft.dct(columns[part], axis=0, norm="ortho") * np.sqrt(density)[:, None]
            for part, density, _ in self.spectra
        ]
        return np.concatenate(parts)

    def variances(self, residual: Floats) -> Floats:
        """Estimated variance of the noise at each sample, at least the stated one."""
        mean = np.where(
            self._stated if self.exact else False, 1.0, self.sums(residual) / self._counts
        )
        lengths = np.diff([*self.starts, len(residual)])
        return np.repeat(np.maximum(mean, self.floor), lengths)

    @cached_property
    def samples(self) -> Floats:
        """Independent samples in each series."""
        if self.remainder is None:
            return self._counts
        parts = np.split(self.remainder, self.starts[1:])
        worth = np.array([effective_samples(part) for part in parts])
        return np.asarray(np.minimum(worth, self._counts))

    @cached_property
    def floor(self) -> Floats:
        """Least variance of the noise of each series."""
        return np.where(self._stated, 1.0, _TINY)

    @cached_property
    def _counts(self) -> Floats:
        return np.array(self.counts, dtype=float)

    @cached_property
    def _stated(self) -> Mask:
        return np.array(self.stated)


def effective_samples(values: Floats) -> float:
    """Number of independent samples that `values` are worth: their participation number.

    3 (Σ c²)² / Σ c⁴ over the coefficients c of the discrete cosine transform, which is n for
    white noise, and 3 for a single line. Unlike the integrated autocorrelation time it does not
    vanish for a residual that rings.
    """
    powers = fft.dct(values, norm="ortho") ** 2
    concentration = float(powers @ powers)
    if not concentration:
        return float(len(values))
    return float(min(len(values), 3 * powers.sum() ** 2 / concentration))
