"""The motion that a free-form term is a function of, from labels or from what is predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.series import Floats, Series

# Values of a term's parameters, by name.
Values = Mapping[str, float]

POSITION = "position"
# Size of a term that is looked for, as a multiple of the largest value measured.
LARGEST = 1 / LEAST_SHARE**2


@dataclass(frozen=True)
class Motion:
    """The motion that a term depends on (samples): labels of a series, or what is predicted."""

    series: Series
    predicted: Floats | None = None

    @property
    def time_s(self) -> Floats:
        return values_of(self.series, "")

    @property
    def position(self) -> Floats:
        return values_of(self.series, POSITION) if self.predicted is None else self.predicted

    @property
    def velocity(self) -> Floats:
        if self.predicted is None:
            return self.label("velocity")
        return np.gradient(self.predicted, self.time_s)

    @property
    def acceleration(self) -> Floats:
        if self.predicted is None:
            return self.label("acceleration")
        return np.gradient(self.velocity, self.time_s)

    @property
    def direction(self) -> Floats:
        """Sign of the last motion; 0 before the first."""
        sign = np.sign(self.velocity)
        last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), -1))
        return np.where(last >= 0, sign[last], 0.0)

    def label(self, name: str) -> Floats:
        return values_of(self.series, name)

    def seconds_of(self, name: str) -> Floats:
        """Time (s) spent so far where a label was not 0 (samples)."""
        during = self.label(name)[:-1] != 0
        return np.concatenate([[0.0], np.cumsum(np.diff(self.time_s) * during)])

    @property
    def starts(self) -> Floats:
        """Number of moves begun so far: the commanded speed has left 0 so often (samples)."""
        moving = self.label("velocity") != 0
        return np.cumsum(np.diff(moving.astype(float), prepend=0.0) > 0).astype(float)


def motion_of(series: Series, predicted: Floats) -> Motion:
    """Motion that is predicted, of places at ascending times; else that of the labels."""
    time_s = series.time_s
    has_place = series.of_place and time_s is not None and bool((np.diff(time_s) > 0).all())
    return Motion(series, predicted if has_place and len(series) > 1 else None)


def labelled(series: Sequence[Series], label: str) -> bool:
    """True if all series have a label, which is not their own values."""
    return all(
        label in s.labels and not np.array_equal(values_of(s, label), s.values) for s in series
    )


def values_of(series: Series, label: str) -> Floats:
    """A label of a series (samples); "" is its time (s)."""
    values = series.time_s if label == "" else series.labels[label]
    return np.asarray(values, dtype=float)


def step_of(series: Series) -> float:
    """The median time (s) between two samples; 1 if there is one alone."""
    return float(np.median(np.diff(values_of(series, "")))) if len(series) > 1 else 1.0


def span_of(series: Sequence[Series]) -> float:
    """The widest range of the values of a series, in their unit; 1 if all are constant."""
    return max(float(np.ptp(s.values)) for s in series) or 1.0
