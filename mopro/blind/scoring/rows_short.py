"""Statistics of the grid `short`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.blind.making.sizes import RESOLUTION_SIGMA
from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.outcome import NONE, UNEXPLAINED, WRONG
from mopro.blind.scoring.rows import TableRow, share


def short_rows(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on all cases, on those with an effect that shows, and on those without one."""
    seen = [j for j in cases if j.truth and j.least_sigma >= RESOLUTION_SIGMA]
    null = [j for j in cases if not j.truth]
    yield share("one short run: a wrong name", cases, 0.015, _is_wrong, at_most=True)
    yield share("8 σ or more: right name, family or alternative", seen, 0.95, lambda j: j.good)
    yield share("one short run: unexplained", cases, 0.03, _is_unexplained, at_most=True)
    yield share("nothing hidden: none", null, None, lambda j: j.verdict == NONE)


def _is_wrong(j: Judgement) -> bool:
    return j.outcome == WRONG


def _is_unexplained(j: Judgement) -> bool:
    return j.verdict == UNEXPLAINED
