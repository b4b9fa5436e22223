"""Gaps of a series, and the times at which it is drawn so that they stay gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.engine.series import Floats, Series
from mopro.logs.timed import spacing_of


@dataclass(frozen=True)
class Drawn:
    """Times (s) at which a series is drawn: those of its samples, at `places`, and of its gaps.

    `command`: the commanded place at each of the times, from the run's own rows; None where the
    series is not of a place, or no command is known.
    """

    time_s: Floats
    places: NDArray[np.intp]
    command: Floats | None

    def of(self, values: Floats) -> Floats:
        """Values of the samples at all times that are drawn, NaN in the gaps."""
        drawn = np.full(len(self.time_s), np.nan)
        drawn[self.places] = values
        return drawn


def drawn(series: Series) -> Drawn:
    """The times of a series, with those of its gaps between them; rows from 1 without times."""
    if series.time_s is None:
        count = len(series)
        return Drawn(np.arange(1.0, count + 1), np.arange(count), _labelled(series))
    own = np.asarray(series.time_s, np.float64)
    between = list(_between(series, own))
    time_s = np.sort(np.concatenate([own, *between]))
    places = np.searchsorted(time_s, own).astype(np.intp)
    return Drawn(time_s, places, _command(series, time_s, places))


def _between(series: Series, own: Floats) -> Iterator[Floats]:
    """Times in each gap: of the run's rows there, or as far apart as the samples are."""
    if len(own) < 2 or np.any(np.diff(own) <= 0):
        return
    spacing = spacing_of(own)
    rows = None if series.path is None else series.path[0]
    if rows is not None and spacing.regular:
        yield rows[(rows < own[0]) | (rows > own[-1])]
    for before in spacing.gaps:
        begin, end = float(own[before]), float(own[before + 1])
        found = np.empty(0) if rows is None else rows[(rows > begin) & (rows < end)]
        if not len(found):
            count = min(round((end - begin) / spacing.interval_s) - 1, len(own))
            found = np.linspace(begin, end, max(count, 1) + 2)[1:-1]
        yield found


def _command(series: Series, time_s: Floats, places: NDArray[np.intp]) -> Floats | None:
    labelled = _labelled(series)
    if labelled is None:
        return None
    if series.path is not None:
        rows, values = series.path
        inside = (time_s >= rows[0]) & (time_s <= rows[-1])
        return np.where(inside, np.interp(time_s, rows, values), np.nan)
    command = np.full(len(time_s), np.nan)
    command[places] = labelled
    return command


def _labelled(series: Series) -> Floats | None:
    """The position of the series' labels, where it is what the sensor measures."""
    position = series.labels.get("position")
    if position is None or series.position_unit != series.unit:
        return None
    return np.asarray(position, dtype=np.float64)
