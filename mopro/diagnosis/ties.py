"""Order by EBIC in which rounding and the end of a fit decide nothing: ties go by a fixed order."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from mopro.diagnosis.fit import CHI2_TOLERANCE

# EBIC within which two explanations tie: as far as a fit may stop above its minimum. Rounding
# parts effects that are the same function of the motion by 1e-8 at an EBIC of 2e5.
TIE = CHI2_TOLERANCE

T = TypeVar("T")


def lowest_first(
    items: Iterable[T], ebic: Callable[[T], float], place: Callable[[T], Any]
) -> list[T]:
    """`items`, the lowest EBIC first; those within `TIE` of the lowest left, by their `place`."""
    ranked = sorted(((ebic(item), item) for item in items), key=lambda pair: pair[0])
    values = [value for value, _ in ranked]
    ordered: list[T] = []
    while (start := len(ordered)) < len(ranked):
        end = bisect_right(values, values[start] + TIE, lo=start + 1)
        ordered += sorted((item for _, item in ranked[start:end]), key=place)
    return ordered
