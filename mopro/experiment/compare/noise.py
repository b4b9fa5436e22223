"""Wild samples, and white noise larger than stated, which a comparison does not judge.

A repaired machine that `reconcile` calls right must not be a disagreement to `compare`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from mopro.engine.assumed import TOLERANCE
from mopro.engine.residuals import difference_variance, without_wild
from mopro.engine.series import Floats, Series


def without_wild_samples(
    data: Sequence[Series], left: Sequence[Floats]
) -> tuple[list[Series], tuple[str, ...]]:
    """The series without their wild and repeated samples, by what is `left` of them, and notes.

    Rows of a table have no neighbours that a wild one could differ from.
    """
    parts = [
        (series, list[str]()) if series.time_s is None else without_wild(series, own)
        for series, own in zip(data, left, strict=True)
    ]
    return [series for series, _ in parts], tuple(note for _, notes in parts for note in notes)


def larger_noise(data: Sequence[Series], z: Sequence[Floats]) -> list[float]:
    """Ratio of each series' noise, by differences of neighbouring samples, to the stated noise.

    `z`: what is left of each series in standard deviations. 1 where it is as stated, or unknown.
    """
    factors = [
        math.sqrt(difference_variance(own[series.counted]))
        if series.sigma and series.time_s is not None
        else 1.0
        for series, own in zip(data, z, strict=True)
    ]
    return [factor if factor > 1 + TOLERANCE else 1.0 for factor in factors]


def noise_notes(data: Sequence[Series], factors: Sequence[float]) -> Iterator[str]:
    """A note on each series whose noise is not as stated."""
    for series, factor in zip(data, factors, strict=True):
        if factor != 1:
            yield (
                f"the noise of {series.sensor} in {series.run} is {factor:.2g} times as much as "
                "stated, and white"
            )
