"""Statistics of the grid `foreign`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.outcome import NONE, UNEXPLAINED, WRONG
from mopro.blind.scoring.rows import CLEAR_SIGMA, TableRow, share


def foreign_rows(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on physics and faults, on the effects beside them, and on coloured noise."""
    noise = [j for j in cases if j.coloured]
    real = [j for j in cases if not j.coloured]
    beside = [j for j in cases if j.truth and j.least_sigma >= CLEAR_SIGMA]
    yield share("foreign: a false clean name", cases, 0.02, _false_and_clean, at_most=True)
    yield share("foreign: a false name beside something unexplained", cases, None, _false_beside)
    yield share("foreign: unexplained and described", real, None, _described)
    yield share("foreign: right variable", real, 0.70, lambda j: j.right_variable)
    yield share("an effect beside it, 20 σ or more: named with its size", beside, 0.90,
                lambda j: j.size_is_right)  # fmt: skip
    yield share("coloured noise of the stated size: none",
                [j for j in noise if not j.truth], 0.95, lambda j: j.verdict == NONE)  # fmt: skip


def _false_and_clean(j: Judgement) -> bool:
    return j.outcome == WRONG and j.verdict != UNEXPLAINED


def _false_beside(j: Judgement) -> bool:
    return j.outcome == WRONG and j.verdict == UNEXPLAINED


def _described(j: Judgement) -> bool:
    return j.verdict == UNEXPLAINED and j.described
