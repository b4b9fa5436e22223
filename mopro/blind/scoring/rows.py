"""Rows of a table of statistics, each with its target."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

# Total size (σ) from which an effect is clear.
CLEAR_SIGMA = 20.0

T = TypeVar("T")


@dataclass(frozen=True)
class TableRow:
    """One statistic over `count` cases; `met` is None if there is no target or no case."""

    what: str
    target: str
    count: int
    reached: str
    met: bool | None


def share(
    what: str,
    cases: Sequence[T],
    target: float | None,
    holds: Callable[[T], bool],
    at_most: bool = False,
) -> TableRow:
    """The share of `cases` for which `holds`; the target, if any, is a least or a most."""
    count = sum(map(holds, cases))
    if target is None:
        return TableRow(what, "-", len(cases), percent(count, len(cases)), None)
    reached = count / len(cases) if cases else 0.0
    met = (reached <= target if at_most else reached >= target) if cases else None
    sign = "≤" if at_most else "≥"
    return TableRow(what, f"{sign} {100 * target:g}%", len(cases), percent(count, len(cases)), met)


def percent(count: int, of: int) -> str:
    """The share of `count` in `of`, with both; "-" of none."""
    return f"{count / of:.1%} ({count} of {of})" if of else "-"
