"""Statistics of the grid `machines`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from statistics import median

from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.outcome import NONE, UNEXPLAINED, WRONG
from mopro.blind.scoring.rows import CLEAR_SIGMA, TableRow, percent, share

# A file that leaves this much more of an unseen run (relative) is worse than none: 10 of
# chi-squared in 1000 readings.
_WORSE = 1.005


def machines_rows(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on nulls, names, intervals, the repaired file and unseen runs."""
    null = [j for j in cases if j.group == NONE]
    listed = [j for j in cases if j.group == "listed" and j.least_sigma >= CLEAR_SIGMA]
    odd = [j for j in cases if j.group == "unlisted"]
    filed = [j for j in cases if j.same is not None]
    unseen = [j for j in cases if j.unseen_after is not None]
    yield share("nothing hidden: no name", null, 1.0, lambda j: not j.said)
    yield share("listed, 20 σ or more: right or an alternative", listed, 0.90, lambda j: j.good)
    yield share("a false name, clean", cases, 0.01, lambda j: _false(j) and _clean(j), at_most=True)
    yield share(
        "a false name beside something unexplained", cases, 0.03,
        lambda j: _false(j) and not _clean(j), at_most=True,
    )  # fmt: skip
    yield share("not listed: drafted, nothing named clean", odd, None, lambda j: j.good)
    yield _intervals(cases)
    yield share(
        "the file leaves what the verdict says, to 1e-9", filed, 1.0, lambda j: bool(j.same)
    )
    yield share("an unseen run is predicted worse than by no repair", unseen, 0.0, _worse, True)
    yield _closed(unseen)


def _false(j: Judgement) -> bool:
    return j.outcome == WRONG or (j.group == NONE and bool(j.said))


def _clean(j: Judgement) -> bool:
    return j.verdict != UNEXPLAINED and not j.drafted


def _worse(j: Judgement) -> bool:
    return (j.unseen_after or 0.0) > _WORSE * (j.unseen_before or 0.0)


def _intervals(cases: Sequence[Judgement]) -> TableRow:
    every = [c.inside for j in cases for c in j.covered]
    met = 0.93 <= sum(every) / len(every) <= 0.97 if every else None
    what = "95 % intervals that contain the true value"
    return TableRow(what, "93 to 97 %", len(every), percent(sum(every), len(every)), met)


def _closed(unseen: Sequence[Judgement]) -> TableRow:
    """The share of the gap of an unseen run, down to the noise, that the file closes."""
    gaps = [j for j in unseen if (j.unseen_before or 0.0) > 1.5 and j.good]
    shares = [1 - _over(j.unseen_after) / _over(j.unseen_before) for j in gaps]
    reached = f"median {median(shares):.1%}, least {min(shares):.1%}" if shares else "-"
    return TableRow(
        "share of an unseen gap that is closed, where right", "-", len(gaps), reached, None
    )


def _over(ratio: float | None) -> float:
    """Root of what is over the noise."""
    return math.sqrt(max((ratio or 0.0) ** 2 - 1, 0.0))
