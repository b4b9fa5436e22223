"""Measured less simulated, in standard deviations, with the nuisances taken out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mopro.diagnosis.model import Floats, Mask, Series, Settings, Simulate


class Residuals:
    """All series of a problem as one vector.

    `weights` are 1/sigma, or 1 for a series of unknown noise; `known` tells whether the
    noise is. A subset of samples (`keep`) is a problem of its own for held-out tests.
    """

    def __init__(
        self, simulate: Simulate, data: Sequence[Series], keep: Mask | None = None
    ) -> None:
        self._simulate = simulate
        self.data = data
        self.known = all(series.sigma is not None for series in data)
        self.keep = np.ones(sum(map(len, data)), dtype=bool) if keep is None else keep
        self.measured = np.concatenate([series.values for series in data])
        self.weights = np.concatenate([np.full(len(s), 1 / (s.sigma or 1.0)) for s in data])
        self._basis = self._nuisance_basis()
        self.count = int(self.keep.sum()) - self._basis.shape[1]

    def subset(self, keep: Mask) -> Residuals:
        return Residuals(self._simulate, self.data, keep)

    def at(self, settings: Settings) -> Floats:
        """The whitened residual of the kept samples with `settings`."""
        predicted = np.concatenate([np.asarray(p, dtype=float) for p in self._simulate(settings)])
        if predicted.shape != self.measured.shape:
            message = (
                f"the model predicts {predicted.size} values for {self.measured.size} measured"
            )
            raise ValueError(message)
        return self.cleaned((self.measured - predicted) * self.weights)

    def cleaned(self, whitened: Floats) -> Floats:
        """The kept part of a whitened vector, nuisances projected out."""
        kept = whitened[self.keep]
        cleaned: Floats = kept - self._basis @ (self._basis.T @ kept)
        return cleaned

    def _nuisance_basis(self) -> Floats:
        """An orthonormal basis of all nuisances on the kept samples."""
        total = sum(series.nuisance_shapes().shape[1] for series in self.data)
        shapes = np.zeros((len(self.measured), total))
        row = column = 0
        for series in self.data:
            own = series.nuisance_shapes()
            shapes[row : row + len(series), column : column + own.shape[1]] = own
            row, column = row + len(series), column + own.shape[1]
        kept = (shapes * self.weights[:, None])[self.keep]
        left, strength, _ = np.linalg.svd(kept, full_matrices=False)
        independent = strength > 1e-9 * max(strength.max(initial=0.0), 1e-300)
        basis: Floats = left[:, independent]
        return basis
