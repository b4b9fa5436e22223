"""Comparison of an experiment on a machine of another kind with its model, part by part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mopro.engine.residuals import whiteness_p
from mopro.engine.series import Series
from mopro.experiment.compare.allowed import Allowed, allowed
from mopro.experiment.compare.comparison import (
    FALSE_ALARMS,
    Compared,
    Comparison,
    Place,
    SeriesTest,
    in_larger_noise,
)
from mopro.experiment.compare.noise import without_wild_samples
from mopro.experiment.compare.noise_tests import chi2_p, mean_p
from mopro.experiment.stated.study import Study
from mopro.formula.evaluate import Floats
from mopro.formula.signals import side

NO_LINE = 0


def compare(study: Study) -> Comparison:
    """The residual of each series, and of its parts in each direction of motion.

    Free numbers are fitted first, and offsets taken out.
    """
    predicted = study.model(study.base.settings)
    residuals = study.residuals(predicted)
    within, left = _within(study.series, residuals)
    data, notes = without_wild_samples(study.series, left)
    if notes:
        # An offset and a tolerance that were fitted to wild samples are off.
        left_out = zip(data, predicted, strict=True)
        residuals = [s.without_nuisances(s.values - own) for s, own in left_out]
        within, left = _within(data, residuals)
    groups = [list(_parts(series)) for series in data]
    level = FALSE_ALARMS / max(2 * len(residuals) + 2 * sum(map(len, groups)), 1)
    compared = [Compared(s, r) for s, r in zip(data, residuals, strict=True)]

    def judge(z: Sequence[Floats]) -> Comparison:
        every = list(zip(data, residuals, z, strict=True))
        series = [
            _series(s, r, own, level, within.chance.get(s.sensor, 1.0)) for s, r, own in every
        ]
        where = [
            _place(s, r, own, rows, level)
            for (s, r, own), parts in zip(every, groups, strict=True)
            for rows in parts
            if len(rows)
        ]
        return Comparison.of(where, series, compared, within.told, notes)

    return in_larger_noise(data, [_scaled(s, r) for s, r in zip(data, left, strict=True)], judge)


def _within(data: Sequence[Series], residuals: Sequence[Floats]) -> tuple[Allowed, list[Floats]]:
    """Fitted tolerances of the sensors, and the residuals without them, in the series' units."""
    within = allowed(data, residuals)
    parts = zip(residuals, within.off, strict=True)
    return within, [own if off is None else own - off for own, off in parts]


def _scaled(series: Series, left: Floats) -> Floats:
    """A residual in standard deviations of the noise; in its unit where the noise is unknown."""
    return left if series.sigma is None else left / series.sigma


def _direction(series: Series) -> Floats:
    """The direction of motion of each sample; 0 where there is none."""
    velocity = series.labels.get("velocity")
    if velocity is None or series.time_s is None:
        return np.zeros(len(series))
    return side(series.time_s, np.asarray(velocity, dtype=float))


def _parts(series: Series) -> Iterator[np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """Rows of each part of a run, in each direction."""
    assert series.folds is not None, "a reading has parts"
    keys = series.folds * 3 + _direction(series).astype(np.int64)
    for key in np.unique(keys):
        yield np.flatnonzero((keys == key) & series.counted)


def _place(
    series: Series, residual: Floats, z: Floats,
    rows: np.ndarray[tuple[int], np.dtype[np.intp]], level: float,
) -> Place:  # fmt: skip
    """The place at `rows`; `z` is what is left of the residual, in standard deviations."""
    own, sigma, time_s = z[rows], series.sigma, series.time_s
    assert time_s is not None, "a reading has times"
    p_value = None if sigma is None else min(chi2_p(own), mean_p(own))
    return Place.of(
        residual[rows],
        sigma,
        p_value,
        level,
        run=series.run,
        line=NO_LINE,
        phase=f"{time_s[rows[0]]:.4g} to {time_s[rows[-1]]:.4g} s",
        axis=None,
        direction=int(_direction(series)[rows[0]]),
        sensor=series.sensor,
        unit=series.unit,
    )


def _series(series: Series, residual: Floats, z: Floats, level: float, chance: float) -> SeriesTest:
    sigma, own = series.sigma, z[series.counted]
    size_p = None if sigma is None else min(chi2_p(own, fitted=1), chance)
    memory_p = None if sigma is None else whiteness_p(own)
    return SeriesTest.of(
        residual[series.counted], sigma, size_p, memory_p, level,
        run=series.run, sensor=series.sensor, unit=series.unit,
    )  # fmt: skip


def worst(places: Sequence[Place], most: int) -> tuple[Place, ...]:
    """The significant places; where no noise is known, the largest."""
    known = [place for place in places if place.significant]
    return tuple(known or [p for p in places if p.sigma is None])[:most]
