"""Readings that stay at exactly the largest or the smallest value: at the end of a range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.noise.odd import MAD_TO_SIGMA, STUCK_ALARM, held_of, runs_of
from mopro.noise.step import distinct_of

Floats = NDArray[np.float64]

# Differences of this order leave next to nothing of a motion, and of white noise the root of the
# sum of their squared weights: 1, 4, 6, 4, 1.
_ORDER = 4
_GAIN = 70.0**0.5
# Equal readings in a row from which they stay, see _stays.
_FEWEST = 3
# Share of readings at one value from which that is where the column is mostly: its rest, or none.
_MOSTLY = 0.5
# The sharpest bend of a motion is at most so much sharper than the others. Halved, one in a few
# motions without noise has a sharper one; doubled, only a fast motion is seen to be cut off.
_AS_BENT = 2.0


@dataclass(frozen=True)
class End:
    """The `largest` or the smallest value of a column, at which readings stay.

    `at` (n) marks all readings of it; `first` is the index where they stay for the first time.
    `certain`: the noise of the others excludes that it is a rest. `sharp`: so does the inertia of
    what is measured, as it comes to no other rest so suddenly.
    """

    value: float
    largest: bool
    at: NDArray[np.bool_]
    first: int
    certain: bool
    sharp: bool

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.at))

    def words(self, unit: str) -> str:
        """`45 readings are exactly 10 V, the largest of all: at the end of its range?`"""
        which = "largest" if self.largest else "smallest"
        value = f"{self.value:.10g}{unit and ' '}{unit}"
        return (
            f"{self.count} readings are exactly {value}, the {which} of all: at the end of its"
            " range?"
        )


def ends_of(values: Floats) -> Iterator[End]:
    """The ends of a column (n, without NaN) at which at least three readings stay.

    A rest has noise, and where a converter hides it other rests repeat one value as well. So a run
    of equal readings is no rest if the others, which are more, show their noise and stay at no
    other value.
    """
    if not len(values):
        return
    at = {True: values == values.max(), False: values == values.min()}
    if not any(map(_stays, at.values())) or values.min() == values.max():
        return
    held = held_of(values)
    kept = slice(len(values) % held, None, held)
    longest = _longest_rest(values[kept])
    starts, lengths = runs_of(values[kept])
    most = {largest: np.where(own[kept][starts], lengths, 1) for largest, own in at.items()}
    elsewhere = int(np.where((most[True] == 1) & (most[False] == 1), lengths, 1).max())
    for largest, own in most.items():
        if own.max() >= _FEWEST:
            first = int(starts[int(np.argmax(own >= _FEWEST))]) * held + len(values) % held
            certain = bool(own.max() > longest >= elsewhere)
            sharp = _is_sharp(values[kept], at[largest][kept])
            some = bool(at[largest].mean() < _MOSTLY)
            value = float(values[first])
            yield End(value, largest, at[largest], first, some and certain, some and sharp)


def _stays(at: NDArray[np.bool_]) -> bool:
    return bool(np.any(at[2:] & at[1:-1] & at[:-2]))


def _is_sharp(values: Floats, at: NDArray[np.bool_]) -> bool:
    """True if the speed changes as nowhere else where readings come to stay `at` an end."""
    steps = np.diff(values)
    bends = np.abs(steps[2:] - steps[:-2])
    windows = np.convolve(at, np.ones(4, int), "valid")
    edges = (windows > 0) & (windows < 4)
    apart = windows == 0
    if not edges.any() or not apart.any():
        return False
    return bool(np.median(bends[edges]) > _AS_BENT * bends[apart].max())


def _longest_rest(values: Floats) -> float:
    """The longest run of equal readings that noise leaves by chance; infinite if none shows."""
    step, level = float(np.diff(distinct_of(values)).min(initial=np.inf)), _level(values)
    if level <= step:
        return np.inf
    # Two readings of one rest are equal with the density of their difference at 0, times the step.
    equal = max(step / (2 * np.sqrt(np.pi) * level), 1 / len(values))
    return float(2 + np.log(len(values) / STUCK_ALARM) / -np.log(equal))


def _level(values: Floats) -> float:
    """The noise between neighbours where readings change; 0 where they go on smoothly."""
    if len(values) <= _ORDER + 1:
        return 0.0
    bends = np.diff(values, _ORDER)
    equal = np.concatenate(([0], np.cumsum(np.diff(values) == 0)))
    changes = equal[_ORDER:] - equal[:-_ORDER] < _ORDER
    both = changes[1:] & changes[:-1]
    # Those of noise mostly change their sign from one to the next, those of a motion do not.
    if np.count_nonzero((bends[1:] * bends[:-1] < 0) & both) <= np.count_nonzero(both) / 2:
        return 0.0
    return float(MAD_TO_SIGMA * np.median(np.abs(bends[changes])) / _GAIN)
