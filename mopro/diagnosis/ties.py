"""Order by EBIC in which rounding decides nothing: near ties go by the catalogue's order."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

# EBIC within which two explanations tie: a Bayes factor of 1.0005, which is no evidence. Rounding
# parts effects that are the same function of the motion by 1e-8 at most (at an EBIC of 2e5).
TIE = 1e-3

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
