"""Comparison of an experiment on a machine of another kind with its model, part by part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mopro.experiment.compare.allowed import allowed
from mopro.experiment.compare.comparison import (
    FALSE_ALARMS,
    Compared,
    Comparison,
    Place,
    SeriesTest,
)
from mopro.experiment.compare.noise_tests import chi2_p, mean_p
from mopro.experiment.rigs.study import Study
from mopro.formula.evaluate import Floats
from mopro.formula.signals import side
from mopro.residuals import whiteness_p
from mopro.series import Series

NO_LINE = 0


def compare(study: Study) -> Comparison:
    """The residual of each series, and of its parts in each direction of motion.

    Free numbers are fitted first, and offsets taken out.
    """
    residuals = study.residuals(study.model(study.base.settings))
    groups = [list(_parts(series)) for series in study.series]
    within = allowed(study.series, residuals)
    left = [r if off is None else r - off for r, off in zip(residuals, within.off, strict=True)]
    tests = 2 * len(residuals) + 2 * sum(map(len, groups))
    level = FALSE_ALARMS / max(tests, 1)
    triples = list(zip(study.series, residuals, left, strict=True))
    series = [_series(s, r, own, level, within.chance.get(s.sensor, 1.0)) for s, r, own in triples]
    where = [
        _place(s, r, own, rows, level)
        for (s, r, own), parts in zip(triples, groups, strict=True)
        for rows in parts
    ]
    compared = [Compared(s, r) for s, r in zip(study.series, residuals, strict=True)]
    return Comparison.of(where, series, compared, within.told)


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
        yield np.flatnonzero(keys == key)


def _place(
    series: Series, residual: Floats, left: Floats,
    rows: np.ndarray[tuple[int], np.dtype[np.intp]], level: float,
) -> Place:  # fmt: skip
    """The place at `rows`; `left` is the residual without what the tolerances allow."""
    own, sigma, time_s = left[rows], series.sigma, series.time_s
    assert time_s is not None, "a reading has times"
    p_value = None if sigma is None else min(chi2_p(own / sigma), mean_p(own / sigma))
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


def _series(
    series: Series, residual: Floats, left: Floats, level: float, chance: float
) -> SeriesTest:
    sigma = series.sigma
    size_p = None if sigma is None else min(chi2_p(left / sigma, fitted=1), chance)
    memory_p = None if sigma is None else whiteness_p(left / sigma)
    return SeriesTest.of(
        residual, sigma, size_p, memory_p, level,
        run=series.run, sensor=series.sensor, unit=series.unit,
    )  # fmt: skip


def worst(places: Sequence[Place], most: int) -> tuple[Place, ...]:
    """The significant places; where no noise is known, the largest."""
    known = [place for place in places if place.significant]
    return tuple(known or [p for p in places if p.sigma is None])[:most]
