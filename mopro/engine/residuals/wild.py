"""Samples that decide nothing: wild ones, dropouts, rough ends, and readings that are repeated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import special

from mopro.engine.assumed import (
    FALSE_ALARMS,
    FEWEST,
    LEAST_SAMPLES,
    LEAST_SHARE,
    MAJORITY,
    ROUNDING,
    TOLERANCE,
)
from mopro.engine.series import Floats, Mask, Series

# Standard deviation of the distance of a sample from the median of its 2 FEWEST neighbours, for
# white noise of variance 1: the variance of a median is π/2 that of a mean.
_DEVIATION = math.sqrt(1 + math.pi / 2 / (2 * FEWEST))
# Median of |z| for a standard normal number z.
_QUARTILE = float(special.ndtri(0.75))
# Share of a series that a dropout lasts at the most.
_SHORT = LEAST_SHARE**2


def without_rough_ends(series: Series, residual: Floats) -> tuple[Series, list[str]]:
    """`series` without the few samples beyond a jump of its readings near an end, and a note.

    `residual`: of the model as it is, in the unit of the series. Nothing tells there whether a jump
    would lead back, and an effect that takes the shape of one would be named for a few samples.
    """
    least = least_noise(series.values, series.sigma)
    starts = _rough_start(series.values, residual, least)
    ends = _rough_start(series.values[::-1], residual[::-1], least)[::-1]
    return _without(series, {"wild": starts | ends})


def without_wild(series: Series, residual: Floats) -> tuple[Series, list[str]]:
    """`series` without its wild samples and the repeated ones, and a note on each of the kinds.

    `residual`: what the best set leaves, in the unit of the series.
    """
    least = least_noise(series.values, series.sigma)
    wild = wild_samples(residual, least)
    repeated = repeated_samples(series.values, residual, least)
    return _without(series, {"wild": wild, "repeated": repeated})


def least_noise(values: Floats, stated: float | None) -> float:
    """The standard deviation of the noise in readings at the least: stated, or of one step of them.

    A reading may flip by one step of its converter in the slightest noise. Infinite where all
    readings are equal.
    """
    steps = np.diff(np.unique(values))
    seen = steps[steps > ROUNDING * steps.sum()]
    return max(stated or 0.0, float(seen.min(initial=math.inf)) / math.sqrt(12))


def _without(series: Series, kinds: Mapping[str, Mask]) -> tuple[Series, list[str]]:
    """`series` without the samples of each of `kinds`, and a note on those that counted so far."""
    notes, out = list[str](), ~series.counted
    for kind, found in kinds.items():
        samples = found & series.counted
        if not samples.any():
            continue
        out |= samples
        at, count = int(np.flatnonzero(samples)[0]), int(samples.sum())
        where = f"sample {at + 1}" if series.time_s is None else f"{series.time_s[at]:.4g} s"
        told = f"{count} {kind} samples, the first" if count > 1 else f"one {kind} sample,"
        notes.append(f"{series.sensor} in {series.run} has {told} at {where}: left out")
    return (replace(series, wild=out) if notes else series), notes


def wild_samples(residual: Floats, least: float) -> Mask:
    """The samples of one series that are further from their neighbours than noise allows.

    Of noise alone, one series in a thousand has any. The standard deviation of the noise is taken
    from the median distance, and is `least` where that is more. None where they are more than a
    few, or the series shows no noise: a shape is not made of wild samples.
    """
    none = np.zeros(len(residual), dtype=bool)
    if len(residual) < LEAST_SAMPLES:
        return none
    neighbours = _neighbours(residual)
    low, high = neighbours[:, FEWEST - 1], neighbours[:, FEWEST]
    limit = _limit(residual, neighbours, least)
    # Beside a step, half of the neighbours are as the sample is; on the peak of an oscillation they
    # differ among themselves, the extremes left out as one of them may be wild too.
    apart = np.abs(residual - np.clip(residual, low, high))
    apart[0], apart[-1] = _first_apart(residual), _first_apart(residual[::-1])
    spread = neighbours[:, -2] - neighbours[:, 1]
    single = (apart > limit) & (spread < MAJORITY * apart)
    wild = single | _dropouts(residual, _jump(residual, neighbours, least))
    return wild if wild.mean() < TOLERANCE else none


def repeated_samples(values: Floats, residual: Floats, least: float) -> Mask:
    """The samples of one series at which the sensor repeats a reading while the axis moves.

    The run of equal `values` is longer than one in a thousand series has by chance, as often as
    neighbours are equal elsewhere, and the `residual` moves in all of it together by more than
    noise: of a coarse sensor, readings at rest are equal as well. None where every other reading
    is repeated, or a tenth of the series would be left out.
    """
    none = np.zeros(len(values), dtype=bool)
    first = np.flatnonzero(np.r_[True, np.diff(values) != 0])
    lengths = np.diff(np.r_[first, len(values)])
    longest = int(lengths.max())
    others = len(values) - longest
    if len(values) < LEAST_SAMPLES or not others:
        return none
    share = max((others - len(first) + 1) / others, 1 / len(values))
    if share >= MAJORITY:
        return none
    by_chance = 1 + math.log(FALSE_ALARMS / len(values)) / math.log(share)
    limit = _jump(residual, _neighbours(residual), least)
    repeated = none.copy()
    for at, length in zip(first.tolist(), lengths.tolist(), strict=True):
        moved = residual[at : at + length] - residual[at]
        if length > by_chance and np.linalg.norm(moved) > limit:
            # A reading is where the axis was when it was taken, unless the sensor jumped to it.
            jumped = at > 0 and abs(residual[at] - residual[at - 1]) > limit
            repeated[at + (not jumped) : at + length] = True
    return repeated if repeated.mean() < LEAST_SHARE else none


def _rough_start(values: Floats, residual: Floats, least: float) -> Mask:
    """The samples before the last jump of the readings in the first hundredth of a series.

    A jump is a change of the residual above what noise allows. The prediction changes by less than
    half of it there, and so does the residual from each of the next six samples to the one after.
    """
    rough = np.zeros(len(residual), dtype=bool)
    if len(residual) < LEAST_SAMPLES:
        return rough
    near = int(_SHORT * len(residual))
    change = np.diff(residual)
    size, predicted = np.abs(change), np.abs(np.diff(values) - change)
    after = np.lib.stride_tricks.sliding_window_view(size[1:], 2 * FEWEST).max(axis=1)
    settled = np.maximum(after[:near], predicted[:near]) < MAJORITY * size[:near]
    jumps = np.flatnonzero(settled & (size[:near] > _jump(residual, _neighbours(residual), least)))
    if len(jumps):
        rough[: jumps[-1] + 1] = True
    return rough


def _jump(residual: Floats, neighbours: Floats, least: float) -> float:
    """Difference of two samples that noise exceeds in one series of a thousand.

    Infinite where the series shows no noise.
    """
    return math.sqrt(2) * _limit(residual, neighbours, least)


def _limit(residual: Floats, neighbours: Floats, least: float) -> float:
    """Distance from the median of its neighbours that noise exceeds in one series of a thousand.

    Infinite where the series shows no noise.
    """
    middle = (neighbours[:, FEWEST - 1] + neighbours[:, FEWEST]) / 2
    deviation = float(np.median(np.abs(residual - middle))) / _QUARTILE
    distance = -float(special.ndtri(FALSE_ALARMS / (2 * len(residual))))
    return distance * max(deviation, least * _DEVIATION) or math.inf


def _neighbours(residual: Floats) -> Floats:
    """The six samples nearest to each, three on either side except at the ends, sorted (n x 6)."""
    count, places = 2 * FEWEST + 1, np.arange(len(residual))
    first = np.clip(places - FEWEST, 0, len(residual) - count)
    windows = first[:, None] + np.arange(count)
    others = windows[windows != places[:, None]].reshape(len(residual), -1)
    return np.sort(residual[others], axis=1)


def _first_apart(residual: Floats) -> float:
    """Distance of the first sample from where those after it lead back to.

    That is anywhere between the running median of three at the second sample and the line through
    that and the next one: Tukey's rule for the end of a running median (1977).
    """
    second, third = np.median(residual[:3]), np.median(residual[1:4])
    expected = np.median([residual[0], second, 3 * second - 2 * third])
    return float(abs(residual[0] - expected))


def _dropouts(residual: Floats, limit: float) -> Mask:
    """The samples between a jump and one that leads back, a hundredth of the series at most.

    A jump is a difference of two samples above `limit` that those beside it are not half of: an
    oscillation has none.
    """
    wild = np.zeros(len(residual), dtype=bool)
    change = np.diff(residual)
    size = np.abs(change)
    beside = np.maximum(np.r_[0.0, size[:-1]], np.r_[size[1:], 0.0])
    jumps = np.flatnonzero((size > limit) & (beside < MAJORITY * size))
    for first, last in zip(jumps[:-1].tolist(), jumps[1:].tolist(), strict=True):
        leads_back = abs(change[first] + change[last]) < MAJORITY * size[first]
        if last - first <= _SHORT * len(residual) and leads_back:
            wild[first + 1 : last + 1] = True
    return wild
