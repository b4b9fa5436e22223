"""Residual = measured - simulated, in standard deviations, with the nuisances projected out.

What the tolerances of a sensor allow counts as noise: the residual is white where all that it has
beyond noise is as large as those.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from itertools import pairwise
from threading import Lock

import numpy as np
from cachetools import LRUCache, cached
from scipy import linalg

from mopro.engine.assumed import ROUNDING
from mopro.engine.residuals.calibration import Calibration, Corrected, Marginal, corrected
from mopro.engine.series import Floats, Mask, Series, Settings, Simulate, key_of, unless_run_away

# Standard deviations by which a prediction is off that is not finite, and the most that any is.
_FAR = 1e12
# Residuals by the coarse model that are kept: those of the few sets from which many changes are
# taken in turn. Halved, some are worked out again.
_KEPT_COARSE = 8


class Residuals:
    """All series of a problem as one vector (samples of the first series first).

    `sigmas`: standard deviation of the noise in each series, in its unit. `known_noise`: it is
    stated for all of them. Where it is not, the differences between neighbouring samples
    estimate it, so that results do not depend on the units. `mask`: the samples that count; a
    subset of them is a problem of its own for held-out tests, with the `sigmas` of the whole.
    `weights`: 1/sigma of each sample, 0 for wild ones. `count`: samples that count, less the
    nuisances. `coarse`: the same model in larger steps, by which changes are told; the model
    itself if there is none. `calibration`: the terms that the tolerances of the sensors allow.
    """

    def __init__(
        self,
        simulate: Simulate,
        data: Sequence[Series],
        mask: Mask | None = None,
        sigmas: Sequence[float] = (),
        scaled_at: Settings | None = None,
        coarse: Simulate | None = None,
        calibration: Calibration | None = None,
    ) -> None:
        self._simulate, self._coarse = simulate, coarse
        self.data = data
        self.known_noise = all(series.sigma is not None for series in data)
        self.mask = np.ones(sum(map(len, data)), dtype=bool) if mask is None else mask
        self.measured = np.concatenate([series.values for series in data])
        self.sigmas = tuple(sigmas) or self._scales(scaled_at or {})
        self.weights = np.concatenate([
            s.counted / sigma for s, sigma in zip(data, self.sigmas, strict=True)
        ])  # fmt: skip
        self.basis = self.nuisance_basis(self.mask)
        self._shapes = [_support(column) for column in self.basis.T]
        self._calibration, self._marginal = calibration, self._marginal_of(calibration)
        self.count = int(np.count_nonzero(self.weights[self.mask])) - self.basis.shape[1]
        # Asked by several threads at once.
        kept: LRUCache[Hashable, Floats] = LRUCache(_KEPT_COARSE)
        self._known_coarse_at = cached(kept, key=key_of, lock=Lock())(self._coarse_at)

    def subset(self, mask: Mask) -> Residuals:
        """This problem restricted to the samples in `mask`."""
        return Residuals(
            self._simulate, self.data, mask, self.sigmas, coarse=self._coarse,
            calibration=self._calibration,
        )  # fmt: skip

    def calibrated_at(self, settings: Settings) -> Residuals:
        """These data, what the sensors' tolerances allow told about the prediction at `settings`.

        The same problem where all sensors are exact, and no noise of inputs is known.
        """
        if all(series.exact for series in self.data):
            return self
        predicted = self.split(self.predicted(settings))
        return Residuals(
            self._simulate, self.data, self.mask, self.sigmas, coarse=self._coarse,
            calibration=Calibration.of(self.data, predicted, self.sigmas),
        )  # fmt: skip

    def _marginal_of(self, calibration: Calibration | None) -> Marginal | None:
        if calibration is None:
            return None
        columns = [self._without_offsets(column) for column in calibration.columns.T]
        return Marginal(np.column_stack(columns))

    @property
    def log_determinant(self) -> float:
        """That of the covariance of all noise, which `at` makes 1, in the units of the readings."""
        own = -2 * float(np.sum(np.log(self.weights[self.weights > 0])))
        return own + (self._marginal.log_determinant if self._marginal else 0.0)

    def part(self, run: str | None) -> Mask | None:
        """The samples among those in the mask that a number of one run changes; None for all.

        The terms of a sensor are those of all its runs.
        """
        if run is None or any(series.tolerances for series in self.data):
            return None
        own = [np.full(len(series), series.run == run) for series in self.data]
        return np.concatenate(own)[self.mask]

    def beginnings(self, share: float) -> Mask:
        """The samples in this `share` of each series, from its first one on."""
        return np.concatenate([np.arange(len(s)) < share * len(s) for s in self.data])

    def of_model(self, simulate: Simulate, coarse: Simulate | None) -> Residuals:
        """These data and another model of them."""
        return Residuals(
            simulate, self.data, self.mask, self.sigmas, coarse=coarse,
            calibration=self._calibration,
        )  # fmt: skip

    def scaled_at(self, settings: Settings) -> Residuals:
        """These data, noise that is not stated taken from the residual at `settings`."""
        return Residuals(
            self._simulate, self.data, self.mask, scaled_at=settings, coarse=self._coarse
        )

    def _scales(self, settings: Settings) -> tuple[float, ...]:
        stated = [series.sigma for series in self.data]
        if None not in stated:
            return tuple(sigma for sigma in stated if sigma is not None)
        residuals = self.split(self.measured - self.predicted(settings))
        estimated = [
            math.sqrt(difference_variance(own[series.counted])) or 1.0
            for series, own in zip(self.data, residuals, strict=True)
        ]
        return tuple(sigma or scale for sigma, scale in zip(stated, estimated, strict=True))

    def at(self, settings: Settings) -> Floats:
        """Whitened residual of the samples in the mask, with the effects in `settings`.

        Where the model with these effects has no finite value, or has run away, it is as far from
        the data as anything can be: such a set is worth nothing, and ends nothing. All that is
        fitted or judged comes through here, so that nobody else needs to ask.
        """
        return self._whitened(self.predicted(settings))

    def change(self, before: Settings, after: Settings) -> Floats:
        """Change of the whitened residual (samples in the mask) from `before` to `after`.

        By the coarse model: what its steps are off by is nearly the same in both.
        """
        return self._coarse_at(after) - self._known_coarse_at(before)

    def _coarse_at(self, settings: Settings) -> Floats:
        """As `at`, by the coarse model."""
        return self._whitened(self._predicted(self._coarse or self._simulate, settings))

    def _whitened(self, predicted: Floats) -> Floats:
        """Whitened residual of the samples in the mask for a prediction of all."""
        whitened = (self.measured - predicted) * self.weights
        near = np.abs(whitened) < _FAR
        if near.all():
            return self.without_nuisances(whitened)
        residual = self.without_nuisances(np.where(near, whitened, 0.0))
        return np.where(near[self.mask], residual, _FAR)

    def predicted(self, settings: Settings) -> Floats:
        """Predictions of all series in one vector, in their units, NaN where they are not finite.

        Raises ValueError where the model predicts another number of values than were measured.
        """
        return self._predicted(self._simulate, settings)

    def _predicted(self, simulate: Simulate, settings: Settings) -> Floats:
        predictions = [np.asarray(p, dtype=float) for p in simulate(settings)]
        predicted = np.concatenate(predictions) if predictions else np.zeros(0)
        if [len(own) for own in predictions] != [len(series) for series in self.data]:
            message = (
                f"the model predicts {predicted.size} values for {self.measured.size} measured"
            )
            raise ValueError(message)
        return unless_run_away(predicted)

    def without_nuisances(self, whitened: Floats) -> Floats:
        """The samples of a whitened vector in the mask, nuisances projected out.

        White also where the sensors are off within their tolerances.
        """
        return self.white(self._without_offsets(whitened))

    def white(self, residual: Floats) -> Floats:
        """A residual (samples in the mask) to which what the tolerances allow is noise."""
        return residual if self._marginal is None else self._marginal.white(residual)

    def corrected(self, residual: Floats, jacobian: Floats) -> tuple[Corrected, ...]:
        """Fitted tolerances of the sensors, by a residual of this problem (samples).

        `jacobian` (samples x numbers): of the numbers that were fitted beside them.
        """
        if self._calibration is None or self._marginal is None:
            return ()
        return tuple(corrected(self._calibration, *self._marginal.beside(residual, jacobian)))

    def of_exact_sensors(self, settings: Settings) -> list[Floats]:
        """Measured less predicted at `settings`, and less what the tolerances come to there.

        One array for each series, in its unit, with its offset; all samples are in the mask.
        """
        predicted = self.predicted(settings)
        if self._calibration is None or self._marginal is None:
            return self.split(self.measured - predicted)
        mean, _ = self._marginal.terms(self._whitened(predicted))
        sigmas = np.repeat(self.sigmas, [len(series) for series in self.data])
        off = self._calibration.columns @ mean * sigmas
        return self.split(self.measured - off - predicted)

    def _without_offsets(self, whitened: Floats) -> Floats:
        left = whitened[self.mask]
        for rows, shape in self._shapes:
            own = left[rows]
            own -= shape * (shape @ own)
        return left

    def split(self, joined: Floats) -> list[Floats]:
        """A vector over all series as one array for each."""
        ends = np.cumsum([0, *map(len, self.data)])
        return [joined[a:b] for a, b in pairwise(ends.tolist())]

    def in_units(self, whitened: Floats) -> list[Floats]:
        """A whitened vector over all samples as one array for each series, in its unit."""
        parts = zip(self.split(whitened), self.sigmas, strict=True)
        return [np.asarray(own * sigma) for own, sigma in parts]

    def nuisance_basis(self, mask: Mask) -> Floats:
        """Orthonormal basis (samples in `mask` x shapes) of the nuisances of all series."""
        columns = []
        end = 0
        for series in self.data:
            own = np.arange(end, end + len(series))
            end += len(series)
            shapes = series.nuisance_shapes()
            # A series has one sigma, so that its weight does not change the basis.
            for shape in linalg.orth(shapes[mask[own]], ROUNDING).T:
                column = np.zeros(len(mask))
                column[own[mask[own]]] = shape
                columns.append(column[mask])
        return np.array(columns).T if columns else np.zeros((int(mask.sum()), 0))


def _support(column: Floats) -> tuple[slice, Floats]:
    """The samples from the first to the last one at which a column is not 0, and it there."""
    rows = np.flatnonzero(column)
    own = slice(int(rows[0]), int(rows[-1]) + 1)
    return own, np.ascontiguousarray(column[own])


def projected_out(basis: Floats, vector: Floats) -> Floats:
    """`vector`, or each column of a matrix, less its projection on an orthonormal `basis`."""
    remaining: Floats = vector - basis @ (basis.T @ vector)
    return remaining


def difference_variance(values: Floats) -> float:
    """Variance of the white noise in `values`: half the mean square successive difference.

    Anything slower than the sampling hardly counts (von Neumann et al., 1941).
    """
    return float(np.mean(np.diff(values) ** 2)) / 2 if len(values) > 1 else 0.0
