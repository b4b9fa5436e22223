"""Tolerances of sensors as terms with a normal prior, marginalised in the whitened residual.

With terms B t of width 1 each and white noise, the covariance of a residual is C = 1 + B Bᵀ. The
residual times the inverse root of C is white again, and its sum of squares is the least one of
|r - B t|² + |t|²: every term is fitted with every set of effects, at the price of its prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from mopro.engine.assumed import CLEAR, ROUNDING, STRONG
from mopro.engine.series import Floats, Series

# The tolerance of the terms that noise of the inputs makes.
INPUT_NOISE = "noise of inputs"


@dataclass(frozen=True)
class Corrected:
    """A tolerance of a sensor that the data call for: what its terms come to.

    `values` by parameter: value, unit and 95 % interval. `log_bayes`: ln of the Bayes factor
    against an exact sensor. `sigmas`: distance from that in standard deviations.
    """

    sensor: str
    name: str
    values: dict[str, tuple[float, str, tuple[float, float]]]
    log_bayes: float
    sigmas: float


@dataclass(frozen=True)
class Calibration:
    """The terms of all sensors and inputs.

    `columns` (samples of all series x terms): whitened, of width 1.

    `terms`: sensor, tolerance, parameter, unit and width of each column; those of the noise of
    inputs have the run in place of the sensor, and the tolerance INPUT_NOISE.
    """

    terms: tuple[tuple[str, str, str, str, float], ...]
    columns: Floats

    @staticmethod
    def of(
        data: Sequence[Series], predicted: Sequence[Floats], sigmas: Sequence[float]
    ) -> Calibration | None:
        """The terms of the sensors about what a model predicts; None if all series are exact.

        A sensor has the same terms in all its series.
        """
        starts = np.cumsum([0, *map(len, data)])
        columns: dict[tuple[str, str, str, str, float], Floats] = {}
        for series, own, sigma, start in zip(data, predicted, sigmas, starts, strict=False):
            for term in series.tolerances.terms(series.unit, _read(series, own), series.time_s):
                key = (series.sensor, term.name, term.parameter, term.unit, term.width)
                column = columns.setdefault(key, np.zeros(int(starts[-1])))
                rows = slice(start, start + len(series))
                column[rows] = term.width * term.shape * series.counted / sigma
            of_inputs = () if series.of_inputs is None else series.of_inputs.T
            for nth, shape in enumerate(of_inputs):
                key = (series.run, INPUT_NOISE, f"{nth}", "1", 1.0)
                column = columns.setdefault(key, np.zeros(int(starts[-1])))
                column[start : start + len(series)] = shape * series.counted / sigma
        if not columns:
            return None
        return Calibration(tuple(columns), np.column_stack(list(columns.values())))


def _read(series: Series, predicted: Floats) -> Floats:
    """Readings (n,) of an exact sensor at the model's prediction, with the zero of the readings.

    A prediction has no noise and no wild samples; where it is not finite, the readings stand for
    it.
    """
    finite = np.isfinite(predicted)
    if not finite.any():
        return series.values
    free = series.nuisance_shapes().shape[1] > 0
    zero = float(np.median((series.values - predicted)[finite])) if free else 0.0
    return np.where(finite, predicted + zero, series.values)


class Marginal:
    """The inverse root of the covariance that terms give to whitened samples of unit noise.

    `columns`: theirs (samples x terms), without what the nuisances take out.
    """

    def __init__(self, columns: Floats) -> None:
        self._columns = columns
        samples, count = columns.shape
        basis, sizes, turned = np.linalg.svd(columns, full_matrices=samples < count)
        seen = np.flatnonzero(sizes**2 > ROUNDING)
        self._basis, self._sizes = np.ascontiguousarray(basis[:, seen]), sizes[seen]
        self._turned = turned[seen]
        # Worked out as 1 less what is known, the variance of a term of 1e10 σ would be 0.
        deviations = np.ones(count)
        deviations[seen] /= np.hypot(1.0, self._sizes)
        self._root = turned.T * deviations
        self._taken = 1 - 1 / np.hypot(1.0, self._sizes)

    @property
    def log_determinant(self) -> float:
        """That of the covariance."""
        return float(2 * np.log(np.hypot(1.0, self._sizes)).sum())

    def white(self, residual: Floats) -> Floats:
        """A residual (samples) that has no such terms but in its noise."""
        whitened: Floats = residual - self._basis @ (self._taken * (self._basis.T @ residual))
        return whitened

    def beside(self, white: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
        """As `terms`, where a model's numbers adapt: its `white` Jacobian (samples x numbers)."""
        norms = np.linalg.norm(jacobian, axis=0)
        basis = linalg.orth(self._coloured(jacobian[:, norms > 0] / norms[norms > 0]), ROUNDING)
        left, residual = (v - basis @ (basis.T @ v) for v in (self._columns, self._coloured(white)))
        apart = Marginal(left)
        return apart.terms(apart.white(residual))

    def _coloured(self, white: Floats) -> Floats:
        """The inverse of `white`, also of columns."""
        grown = np.hypot(1.0, self._sizes) - 1
        coloured: Floats = white + self._basis @ (grown * (self._basis.T @ white).T).T
        return coloured

    def terms(self, white: Floats) -> tuple[Floats, Floats]:
        """Means and covariance of the terms, in widths, by a residual that was made `white`."""
        share = self._sizes / np.hypot(1.0, self._sizes)
        mean: Floats = self._turned.T @ (share * (self._basis.T @ white))
        return mean, self._root @ self._root.T


def corrected(calibration: Calibration, mean: Floats, covariance: Floats) -> Iterator[Corrected]:
    """The tolerances that the data call for: odds of 20 to 1 against an exact sensor.

    `mean` and `covariance` of the terms in widths. The Bayes factor of a model against the same
    one with some numbers at 0 is the prior density there over the posterior one (Dickey 1971).
    """
    owners = [(sensor, name) for sensor, name, *_ in calibration.terms]
    for owner in dict.fromkeys(owner for owner in owners if owner[1] != INPUT_NOISE):
        own = [i for i, each in enumerate(owners) if each == owner]
        part, errors = mean[own], covariance[np.ix_(own, own)]
        variances, turned = np.linalg.eigh(errors)
        # One that is lost in the rounding of another is known as well as that at the least.
        variances = np.maximum(variances, variances[-1] * np.finfo(float).eps)
        square = float(np.sum((turned.T @ part) ** 2 / variances))
        log_bayes = (square + float(np.sum(np.log(variances)))) / 2
        if 2 * log_bayes < STRONG:
            continue
        values = {}
        for i in own:
            *_, parameter, unit, width = calibration.terms[i]
            half = CLEAR * width * math.sqrt(covariance[i, i])
            value = width * float(mean[i])
            values[parameter] = value, unit, (value - half, value + half)
        yield Corrected(*owner, values, log_bayes, math.sqrt(square))
