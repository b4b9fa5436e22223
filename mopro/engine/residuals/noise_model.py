"""Noise that residuals are judged by: in each series its size, spectrum and independent samples.

Stated noise is white and of the stated size. What a model leaves of real data seldom is: it has
a memory, so that a thousand samples may be worth fifty independent ones, and its size is not known
beforehand. Its spectrum is then taken from what the fullest set of effects leaves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mopro.engine.assumed import FEWEST, TINY
from mopro.engine.residuals.whitened import Residuals
from mopro.engine.series import Floats, Mask

# Ratio of the first frequencies of neighbouring bands: half an octave.
_BAND = math.sqrt(2)
# Lowest frequencies whose power the mean of a series has. Halved, its error is known to 29 %
# instead of 20; doubled, that of noise that wanders slowly is taken to be smaller.
_LOWEST = 12


@dataclass(frozen=True)
class Noise:
    """Size and spectrum of the noise in each series, in whitened units.

    `counts`: samples that count, less nuisances. `starts`: the first sample of each. `stated`:
    whether the series states its noise. `remainder`: the residual (samples) whose spectrum the
    noise has, None where the noise is white and of the stated size.
    """

    counts: tuple[int, ...]
    starts: tuple[int, ...]
    stated: tuple[bool, ...]
    remainder: Floats | None = None

    @staticmethod
    def as_stated(residuals: Residuals) -> Noise:
        """White noise of the stated sizes; of unknown size where a series states none."""
        lengths = [len(series) for series in residuals.data]
        nuisances = [_rank(series.nuisance_shapes()) for series in residuals.data]
        counted = [int(series.counted.sum()) for series in residuals.data]
        return Noise(
            tuple(max(n - k, 1) for n, k in zip(counted, nuisances, strict=True)),
            tuple(np.cumsum([0, *lengths[:-1]]).tolist()),
            tuple(series.sigma is not None for series in residuals.data),
        )

    def like(self, remainder: Floats) -> Noise:
        """Noise with the size and spectrum of `remainder`."""
        return replace(self, remainder=remainder)

    def of_unknown_size(self) -> Noise:
        """White noise whose size in each series is estimated from a residual."""
        return replace(self, stated=(False,) * len(self.stated))

    @property
    def exact(self) -> bool:
        """True if the noise is white, of the stated sizes where those are known."""
        return self.remainder is None

    def sums(self, residual: Floats) -> Floats:
        """Sum of squares of `residual` in each series."""
        return np.asarray(np.add.reduceat(residual**2, self.starts), dtype=float)

    def deviance(self, residual: Floats) -> float:
        """-2 ln likelihood of a whitened residual, up to a constant.

        Where the noise is not the stated one: the sum over the bands of m ln(1 + (p - q) / S),
        where p and q are the mean powers of `residual` and of the remainder in a band of m
        frequencies, and S = q or the stated power, whichever is more. Less power than q is no
        better. Against what wanders slowly a slow change counts little so, however many the
        samples.
        """
        if self.remainder is None:
            return self.of_sums(self.sums(residual))
        total = 0.0
        for part, first, width, left, density in self.bands:
            power = fft.dct(residual[part], norm="ortho") ** 2
            excess = np.add.reduceat(power, first) / width - left
            total += float(width @ np.log1p(np.maximum(excess, 0.0) / density))
        return total

    def of_sums(self, sums: Floats) -> float:
        """The deviance at a sum of squares of each series, for white noise.

        The sum itself for variance 1; n ln(sum / n) where the size is not stated.
        """
        estimated = self._counts * np.log(np.maximum(sums, TINY) / self._counts)
        return float(np.where(self._stated, sums, estimated).sum())

    @cached_property
    def bands(self) -> list[tuple[slice, NDArray[np.intp], Floats, Floats, Floats]]:
        """For each series its samples, and its bands.

        First frequency, width, power of the remainder and power of the noise of each band.
        Frequencies are those of the cosine transform, bands half an octave wide, of three
        frequencies at least. The power of the noise is that of the remainder, and at least the
        stated one.
        """
        assert self.remainder is not None, "stated noise is white"
        ends = [*self.starts[1:], len(self.remainder)]
        answer = []
        for a, b, least in zip(self.starts, ends, self.floor.tolist(), strict=True):
            power = fft.dct(self.remainder[a:b], norm="ortho") ** 2
            first = _first_frequencies(b - a)
            width = np.diff([*first, b - a]).astype(float)
            mean = np.add.reduceat(power, first) / width
            answer.append((slice(a, b), first, width, mean, np.maximum(mean, least)))
        return answer

    def transformed(self, columns: Floats) -> Floats:
        """Cosine transform of `columns` (samples x any), times the root of the noise's power."""
        return np.concatenate([
            fft.dct(columns[part], axis=0, norm="ortho")
            * np.sqrt(np.repeat(density, width.astype(int)))[:, None]
            for part, _, width, _, density in self.bands
        ])  # fmt: skip

    def spread(self, columns: Floats, inverse: Floats) -> tuple[Floats, Floats]:
        """Covariance of `columns`ᵀ noise, mapped by `inverse`, and degrees of freedom (columns).

        `inverse`: that of the normal matrix of a fit of the columns (samples x columns), which left
        this remainder. What the fit took out of a band counts as no power of the noise there, so
        that the power is that left over the frequencies that are left. The freedom of a variance
        that is a sum over bands is that of Welch and Satterthwaite: few low frequencies tell the
        power that a slow column sees.
        """
        total = np.zeros((columns.shape[1], columns.shape[1]))
        doubt = np.zeros(columns.shape[1])
        taken_out = np.diff([*self.starts, len(columns)]) - np.array(self.counts)
        for (part, first, width, left, _), nuisances, least in zip(
            self.bands, taken_out.tolist(), self.floor.tolist(), strict=True
        ):
            seen = fft.dct(columns[part], axis=0, norm="ortho")
            taken = np.add.reduceat(np.sum((seen @ inverse) * seen, axis=1), first)
            taken[0] += min(nuisances, FEWEST)
            density, freedom = _pooled(left * width, width - taken)
            for begin, end, power, free in zip(
                first.tolist(), [*first[1:].tolist(), len(seen)], density, freedom, strict=True
            ):
                mapped = seen[begin:end] @ inverse
                own = max(power, least) * (mapped.T @ mapped)
                total += own
                # A stated power is known.
                doubt += np.diag(own) ** 2 / free if power > least else 0.0
        certain = np.full_like(doubt, math.inf)
        known = np.divide(np.diag(total) ** 2, doubt, out=certain, where=doubt > 0)
        return total, np.maximum(known, 1.0)

    def variances(self, residual: Floats) -> Floats:
        """Estimated variance of the noise at each sample, at least the stated one."""
        mean = np.where(
            self._stated if self.exact else False, 1.0, self.sums(residual) / self._counts
        )
        lengths = np.diff([*self.starts, len(residual)])
        return np.repeat(np.maximum(mean, self.floor), lengths)

    def power_of_means(self, residual: Floats) -> Floats:
        """Variance of the mean of each series, over that of white noise of the stated size.

        The mean power of the lowest frequencies, without that of the mean itself, which was
        taken out; that of all frequencies of `residual` if the noise is white. 1 at least.
        """
        if self.remainder is None:
            return np.maximum(self.variances(residual)[list(self.starts)], 1.0)
        parts = np.split(self.remainder, self.starts[1:])
        lowest = [fft.dct(part, norm="ortho")[1 : 1 + _LOWEST] for part in parts]
        return np.array([max(float(np.mean(c**2)), 1.0) if len(c) else 1.0 for c in lowest])

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
        return np.where(self._stated, 1.0, TINY)

    @cached_property
    def _counts(self) -> Floats:
        return np.array(self.counts, dtype=float)

    @cached_property
    def _stated(self) -> Mask:
        return np.array(self.stated)


def _pooled(power: Floats, freedom: Floats) -> tuple[list[float], list[float]]:
    """Power of each frequency and degrees of freedom of bands, each with others until it has few.

    `power`: sum over a band. What is left at the end goes with the band before.
    """
    groups: list[list[int]] = [[]]
    for band in range(len(power)):
        if groups[-1] and freedom[groups[-1]].sum() >= FEWEST:
            groups.append([])
        groups[-1].append(band)
    if len(groups) > 1 and freedom[groups[-1]].sum() < FEWEST:
        last = groups.pop()
        groups[-1] += last
    found = [(power[g].sum(), max(float(freedom[g].sum()), 1.0), len(g)) for g in groups]
    shared = [(p / f, f) for p, f, count in found for _ in range(count)]
    return [p for p, _ in shared], [f for _, f in shared]


def _first_frequencies(count: int) -> NDArray[np.intp]:
    """Numbers of the first frequencies of the bands among so many."""
    first = [0]
    while (following := max(first[-1] + FEWEST, int(first[-1] * _BAND))) < count:
        first.append(following)
    return np.array(first)


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


def _rank(shapes: Floats) -> int:
    """The rank of a matrix, 0 for one without columns (which older numpy refuses)."""
    return int(np.linalg.matrix_rank(shapes)) if shapes.size else 0
