"""Measured less simulated, in standard deviations, with the nuisances taken out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy import fft

from mopro.diagnosis.model import Floats, Mask, Series, Settings, Simulate

# Autocorrelation is summed over so many times what it sums up to.
_WINDOW = 5


class Residuals:
    """All series of a problem as one vector.

    `sigmas` are what a standard deviation is in each, and `known` tells whether that is
    stated for all. Where it is not, neighbouring samples tell it: a scale, so that nothing
    hangs on the units, and no more. A subset of samples (`keep`) is a problem of its own
    for held-out tests, with the `sigmas` of the whole.
    """

    def __init__(
        self,
        simulate: Simulate,
        data: Sequence[Series],
        keep: Mask | None = None,
        sigmas: Sequence[float] = (),
    ) -> None:
        self._simulate = simulate
        self.data = data
        self.known = all(series.sigma is not None for series in data)
        self.keep = np.ones(sum(map(len, data)), dtype=bool) if keep is None else keep
        self.measured = np.concatenate([series.values for series in data])
        self.sigmas = tuple(sigmas) or self._scales()
        self.weights = np.repeat([1 / sigma for sigma in self.sigmas], [len(s) for s in data])
        self.basis = self.nuisance_basis(self.keep)
        self.count = int(self.keep.sum()) - self.basis.shape[1]

    def subset(self, keep: Mask) -> Residuals:
        return Residuals(self._simulate, self.data, keep, self.sigmas)

    def burdened(self, residual: Floats) -> Residuals:
        """The same problem with noise as strong as `residual` (all samples), its memory included.

        What is stated counts where that is more.
        """
        parts = zip(self.data, self.split(residual), self.sigmas, strict=True)
        burdens = [
            (series, sigma * math.sqrt(lasting_variance(own))) for series, own, sigma in parts
        ]
        return Residuals(
            self._simulate,
            [replace(series, sigma=max(burden, series.sigma or 0.0) or None)
             for series, burden in burdens],
        )  # fmt: skip

    def _scales(self) -> tuple[float, ...]:
        stated = [series.sigma for series in self.data]
        if None not in stated:
            return tuple(sigma for sigma in stated if sigma is not None)
        left = self.split(self.measured - self.predicted({}))
        told = [math.sqrt(white_variance(own)) or 1.0 for own in left]
        return tuple(sigma or scale for sigma, scale in zip(stated, told, strict=True))

    def at(self, settings: Settings) -> Floats:
        """The whitened residual of the kept samples with `settings`."""
        return self.cleaned((self.measured - self.predicted(settings)) * self.weights)

    def predicted(self, settings: Settings) -> Floats:
        """All series one after the other, in their units."""
        parts = [np.asarray(p, dtype=float) for p in self._simulate(settings)]
        predicted = np.concatenate(parts) if parts else np.zeros(0)
        if [len(part) for part in parts] != [len(series) for series in self.data]:
            message = (
                f"the model predicts {predicted.size} values for {self.measured.size} measured"
            )
            raise ValueError(message)
        return predicted

    def cleaned(self, whitened: Floats) -> Floats:
        """The kept part of a whitened vector, nuisances projected out."""
        return projected_out(self.basis, whitened[self.keep])

    def split(self, joined: Floats) -> list[Floats]:
        """A vector over all series as one array for each."""
        ends = np.cumsum([0, *map(len, self.data)])
        return [joined[a:b] for a, b in pairwise(ends.tolist())]

    def nuisance_basis(self, keep: Mask) -> Floats:
        """An orthonormal basis (kept samples x count) of all nuisances."""
        columns = []
        end = 0
        for series in self.data:
            own = np.arange(end, end + len(series))
            end += len(series)
            shapes = series.nuisance_shapes()
            for shape in _orthonormal(shapes[keep[own]]).T:
                column = np.zeros(len(keep))
                column[own[keep[own]]] = shape
                columns.append(column[keep])
        return np.array(columns).T if columns else np.zeros((int(keep.sum()), 0))


def projected_out(basis: Floats, vector: Floats) -> Floats:
    """`vector`, or each column of a matrix, without its part in an orthonormal `basis`."""
    cleaned: Floats = vector - basis @ (basis.T @ vector)
    return cleaned


def white_variance(values: Floats) -> float:
    """Of the white noise in `values`, by how much neighbours differ (von Neumann, 1941).

    What else is in them, if it is slower, does not count.
    """
    return float(np.mean(np.diff(values) ** 2)) / 2 if len(values) > 1 else 0.0


def lasting_variance(values: Floats) -> float:
    """Of white noise that would leave a mean of many samples as uncertain as `values` do.

    Their variance times the sum of their autocorrelation, over as many lags as five times what
    it comes to (Madras and Sokal, 1988); never less than the variance.
    """
    centred = values - values.mean()
    variance = float(np.mean(centred**2))
    if not variance:
        return 0.0
    length = fft.next_fast_len(2 * len(values), real=True)
    power = np.abs(fft.rfft(centred, length)) ** 2
    correlation = fft.irfft(power, length)[: len(values)] / (len(values) * variance)
    sums = 2 * np.cumsum(correlation) - 1
    enough = np.arange(len(sums)) >= _WINDOW * sums
    lasting = float(sums[np.argmax(enough)])
    return variance * max(lasting, 1.0)


def _orthonormal(shapes: Floats) -> Floats:
    """A basis of the columns; a series has one sigma, so weighing changes nothing."""
    left, strength, _ = np.linalg.svd(shapes, full_matrices=False)
    independent = strength > 1e-9 * max(strength.max(initial=0.0), 1e-300)
    basis: Floats = left[:, independent]
    return basis
