"""Statistics of the grid `deleted`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.outcome import FAMILY, GOOD, WRONG
from mopro.blind.scoring.rows import CLEAR_SIGMA, TableRow, share


def deleted_rows(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on the cases whose effect shows by 20 σ or more beside an offset, and on the others."""
    seen = [j for j in cases if j.visible_sigma >= CLEAR_SIGMA]
    faint = [j for j in cases if j.visible_sigma < CLEAR_SIGMA]
    what = "effect left out, 20 σ or more"
    yield share(f"{what}: a false name", seen, 0.08, _false, at_most=True)
    yield share(f"{what}: right variable, or an equivalent name", seen, 0.75, _right)
    yield share(f"{what}: an equivalent name", seen, None, lambda j: j.outcome == FAMILY)
    yield share("effect left out, below 20 σ: a false name", faint, 0.08, _false, at_most=True)


def _false(j: Judgement) -> bool:
    return j.outcome == WRONG


def _right(j: Judgement) -> bool:
    return j.outcome in GOOD
