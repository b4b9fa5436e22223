"""Stated tolerances of sensors, fitted to residuals at their stated widths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mopro.engine.residuals import Corrected
from mopro.engine.residuals.calibration import Calibration, Marginal, corrected
from mopro.engine.series import Series

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Allowed:
    """`corrections`: those of the residuals, in their units; None for those of exact sensors.

    `chance`: by sensor, that of terms as large as fitted, by their widths. `corrected`: the
    tolerances that the data call for.
    """

    corrections: tuple[Floats | None, ...]
    chance: dict[str, float]
    corrected: tuple[Corrected, ...]


def allowed(data: Sequence[Series], residuals: Sequence[Floats]) -> Allowed:
    """The tolerances of the sensors of `data` fitted to `residuals`, less their offsets.

    A sensor without a known noise is not judged, and counts as exact.
    """
    sigmas = [series.sigma or np.inf for series in data]
    predicted = [series.values - own for series, own in zip(data, residuals, strict=True)]
    calibration = Calibration.of(data, predicted, sigmas)
    if calibration is None:
        return Allowed((None,) * len(data), {}, ())
    white = np.concatenate([own / sigma for own, sigma in zip(residuals, sigmas, strict=True)])
    columns = np.column_stack([_without_offsets(data, c) for c in calibration.columns.T])
    marginal = Marginal(columns)
    mean, covariance = marginal.terms(marginal.white(white))
    parts = np.split(columns @ mean, np.cumsum([len(series) for series in data])[:-1])
    corrections = tuple(
        part * series.sigma if series.sigma and not series.exact else None
        for series, part in zip(data, parts, strict=True)
    )
    called_for = tuple(corrected(calibration, mean, covariance))
    return Allowed(corrections, dict(_chances(calibration, mean)), called_for)


def _without_offsets(data: Sequence[Series], column: Floats) -> Floats:
    parts = np.split(column, np.cumsum([len(series) for series in data])[:-1])
    own = [series.without_nuisances(part) for series, part in zip(data, parts, strict=True)]
    return np.concatenate(own)


def _chances(calibration: Calibration, mean: Floats) -> Iterator[tuple[str, float]]:
    """By sensor, the chance of a sum of squares of its terms, in widths, as large as fitted."""
    sensors = [sensor for sensor, *_ in calibration.terms]
    for sensor in dict.fromkeys(sensors):
        own = mean[[each == sensor for each in sensors]]
        yield sensor, float(special.chdtrc(len(own), own @ own))
