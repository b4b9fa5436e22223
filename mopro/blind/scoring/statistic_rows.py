"""Rows of the tables of statistics, each with its target; the table of each grid."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

from mopro.blind.cases.hidden_sizes import RESOLUTION_SIGMA
from mopro.blind.cases.spec import LASER
from mopro.blind.scoring.judge import DISTINGUISHED_SIGMA, FollowUp, Judgement
from mopro.blind.scoring.outcome import FAMILY, GOOD, NONE, UNEXPLAINED, WRONG

# Total size (σ) from which an effect is clear.
CLEAR_SIGMA = 20.0
_LARGEST_RESIDUAL = 1.1  # held-out rms over the noise, at most
# A file that leaves this much more of an unseen run (relative) is worse than none: 10 of
# chi-squared in 1000 readings.
_WORSE = 1.005

T = TypeVar("T")


@dataclass(frozen=True)
class TableRow:
    """One statistic over `count` cases; `met` is None if there is no target or no case."""

    what: str
    target: str
    count: int
    reached: str
    met: bool | None


def _share(
    what: str,
    cases: Sequence[T],
    target: float | None,
    holds: Callable[[T], bool],
    at_most: bool = False,
) -> TableRow:
    """The share of `cases` for which `holds`; the target, if any, is a least or a most."""
    count = sum(map(holds, cases))
    if target is None:
        return TableRow(what, "-", len(cases), _percent(count, len(cases)), None)
    reached = count / len(cases) if cases else 0.0
    met = (reached <= target if at_most else reached >= target) if cases else None
    sign = "≤" if at_most else "≥"
    return TableRow(what, f"{sign} {100 * target:g}%", len(cases), _percent(count, len(cases)), met)


def _percent(count: int, of: int) -> str:
    """The share of `count` in `of`, with both; "-" of none."""
    return f"{count / of:.1%} ({count} of {of})" if of else "-"


def rows_of(
    grid: str, cases: Sequence[Judgement], followed: Sequence[FollowUp]
) -> Iterator[TableRow]:
    """The table of statistics of a grid; that of the grid `full` if it has none of its own."""
    if grid in _TABLES:
        yield from _TABLES[grid](cases)
        yield _times(cases, grid)
        return
    yield from _full(cases)
    yield _times(cases)
    yield from _follow_ups(followed)


def _good(j: Judgement) -> bool:
    return j.good


def _wrong(j: Judgement) -> bool:
    return j.outcome == WRONG


def _none(j: Judgement) -> bool:
    return j.verdict == NONE


def _unexplained(j: Judgement) -> bool:
    return j.verdict == UNEXPLAINED


def _described(j: Judgement) -> bool:
    return _unexplained(j) and j.described


def _intervals(what: str, low: float, high: float, inside: Sequence[bool]) -> TableRow:
    """The share of intervals that contain the true value, which should lie from `low` to `high`."""
    met = low <= sum(inside) / len(inside) <= high if inside else None
    target = f"{100 * low:g} to {100 * high:g} %"
    return TableRow(what, target, len(inside), _percent(sum(inside), len(inside)), met)


# -- the grids full, small, smoke, noise and base -----------------------------------------------


def _full(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    single = [j for j in cases if len(j.truth) == 1]
    clear = [j for j in single if j.least_sigma >= CLEAR_SIGMA]
    seen = [j for j in single if j.least_sigma >= RESOLUTION_SIGMA]
    faint = [j for j in seen if j.least_sigma < CLEAR_SIGMA]
    below = [j for j in single if j.least_sigma < RESOLUTION_SIGMA]
    null = [j for j in cases if j.group == "none"]
    unknown = [j for j in cases if j.group == "off catalogue"]
    yield _share("one effect, 20 σ or more: right name or family", clear, 0.98, _good)
    yield _share("one effect, 8 to 20 σ: right name or family", faint, 0.85, _good)
    yield _share("one effect, 8 σ or more: a wrong name", seen, 0.01, _wrong, at_most=True)
    yield _share("one effect below 8 σ: no wrong name", below, 0.99, lambda j: not _wrong(j))
    yield _share("nothing hidden: none", null, 0.99, _none)
    for count, name, target in ((2, "two effects", 0.92), (3, "three effects", 0.75)):
        several = [j for j in cases if len(j.truth) == count and j.least_sigma >= CLEAR_SIGMA]
        yield _share(f"{name}, each 20 σ or more: all right", several, target, _good)
    yield _share("off the catalogue: unexplained and described", unknown, 0.90, _described)
    sizes = [c.inside for j in cases for c in j.covered if c.main]
    every = [c.inside for j in cases for c in j.covered]
    yield _intervals("95 % intervals of the size that contain the true value", 0.92, 0.98, sizes)
    yield _share("95 % intervals of all parameters that contain it", every, None, bool)
    yield from _residuals(cases)


def _residuals(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    named = [j for j in cases if j.truth and j.outcome in GOOD and j.gap_after is not None]
    yield _share(
        "held-out residual after the fit, at most 1.1 × noise", named, 1.0,
        lambda j: (j.gap_after or 0.0) <= _LARGEST_RESIDUAL,
    )  # fmt: skip
    yield TableRow(
        "residual before → after, median (worst after), × noise", "-", len(named),
        _median_residuals(named), None,
    )  # fmt: skip


def _median_residuals(named: Sequence[Judgement]) -> str:
    if not named:
        return "-"
    before = median(j.gap_before or 0.0 for j in named)
    after = [j.gap_after or 0.0 for j in named]
    return f"{before:.2f} → {median(after):.3f} ({max(after):.3f})"


def _times(cases: Sequence[Judgement], grid: str = "") -> TableRow:
    timed = [j for j in cases if j.sensor == LASER and j.group != "alike"]
    what, target = "time of a case with the laser", "median ≤ 6 s, worst ≤ 60 s"
    if grid == "machines":
        timed, what = list(cases), "time of a case"
    seconds = [j.seconds for j in timed if j.seconds is not None]
    if not seconds:
        return TableRow(what, target, 0, "-", None)
    reached = f"median {median(seconds):.1f} s, worst {max(seconds):.1f} s"
    met = median(seconds) <= 6 and max(seconds) <= 60
    return TableRow(what, target, len(seconds), reached, met)


def _follow_ups(followed: Sequence[FollowUp]) -> Iterator[TableRow]:
    """Rows on all follow-ups, on those whose alternatives are distinguishable, on alternatives."""
    distinguishable = [f for f in followed if f.all_distinguishable]
    excluded = [excluded for f in followed for excluded in f.excluded()]
    named = sum(f.named for f in followed)
    yield TableRow(
        "ambiguous, named once the proposed experiment (if any) is run", "-", len(followed),
        _percent(named, len(followed)), None,
    )  # fmt: skip
    yield _share(
        f"the same, if each alternative was predicted to differ by {DISTINGUISHED_SIGMA:g} σ",
        distinguishable, 0.90, lambda f: f.named,
    )  # fmt: skip
    yield _share(
        f"alternatives predicted to differ by {DISTINGUISHED_SIGMA:g} σ: excluded",
        excluded, 0.90, lambda e: e,
    )  # fmt: skip


# -- other grids --------------------------------------------------------------------------------


def _foreign(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on physics and faults, on the effects beside them, and on coloured noise."""
    noise = [j for j in cases if j.coloured]
    real = [j for j in cases if not j.coloured]
    beside = [j for j in cases if j.truth and j.least_sigma >= CLEAR_SIGMA]
    yield _share("foreign: a false clean name", cases, 0.02, _false_and_clean, at_most=True)
    yield _share("foreign: a false name beside something unexplained", cases, None, _false_beside)
    yield _share("foreign: unexplained and described", real, None, _described)
    yield _share("foreign: right variable", real, 0.70, lambda j: j.right_variable)
    yield _share("an effect beside it, 20 σ or more: named with its size", beside, 0.90,
                lambda j: j.size_is_right)  # fmt: skip
    yield _share("coloured noise of the stated size: none",
                [j for j in noise if not j.truth], 0.95, _none)  # fmt: skip


def _false_and_clean(j: Judgement) -> bool:
    return _wrong(j) and not _unexplained(j)


def _false_beside(j: Judgement) -> bool:
    return _wrong(j) and _unexplained(j)


def _deleted(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on the cases whose effect shows by 20 σ or more beside an offset, and on the others."""
    seen = [j for j in cases if j.visible_sigma >= CLEAR_SIGMA]
    faint = [j for j in cases if j.visible_sigma < CLEAR_SIGMA]
    what = "effect left out, 20 σ or more"
    yield _share(f"{what}: a false name", seen, 0.08, _wrong, at_most=True)
    yield _share(f"{what}: right variable, or an equivalent name", seen, 0.75, _good)
    yield _share(f"{what}: an equivalent name", seen, None, lambda j: j.outcome == FAMILY)
    yield _share("effect left out, below 20 σ: a false name", faint, 0.08, _wrong, at_most=True)


def _short(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on all cases, on those with an effect that shows, and on those without one."""
    seen = [j for j in cases if j.truth and j.least_sigma >= RESOLUTION_SIGMA]
    null = [j for j in cases if not j.truth]
    yield _share("one short run: a wrong name", cases, 0.015, _wrong, at_most=True)
    yield _share("8 σ or more: right name, family or alternative", seen, 0.95, _good)
    yield _share("one short run: unexplained", cases, 0.03, _unexplained, at_most=True)
    yield _share("nothing hidden: none", null, None, _none)


# -- the grid machines ---------------------------------------------------------------------------


def _machines(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    """Rows on nulls, names, intervals, the repaired file and unseen runs."""
    null = [j for j in cases if j.group == NONE]
    listed = [j for j in cases if j.group == "listed" and j.least_sigma >= CLEAR_SIGMA]
    odd = [j for j in cases if j.group == "unlisted"]
    filed = [j for j in cases if j.same is not None]
    unseen = [j for j in cases if j.unseen_after is not None]
    yield _share("nothing hidden: no name", null, 1.0, lambda j: not j.said)
    yield _share("listed, 20 σ or more: right or an alternative", listed, 0.90, _good)
    yield _share(
        "a false name, clean", cases, 0.01, lambda j: _false(j) and _clean(j), at_most=True
    )
    yield _share(
        "a false name beside something unexplained", cases, 0.03,
        lambda j: _false(j) and not _clean(j), at_most=True,
    )  # fmt: skip
    yield _share("not listed: drafted, nothing named clean", odd, None, _good)
    every = [c.inside for j in cases for c in j.covered]
    yield _intervals("95 % intervals that contain the true value", 0.93, 0.97, every)
    yield _share(
        "the file leaves what the verdict says, to 1e-9", filed, 1.0, lambda j: bool(j.same)
    )
    yield _share("an unseen run is predicted worse than by no repair", unseen, 0.0, _worse, True)
    yield _closed(unseen)


def _false(j: Judgement) -> bool:
    return _wrong(j) or (j.group == NONE and bool(j.said))


def _clean(j: Judgement) -> bool:
    return not _unexplained(j) and not j.drafted


def _worse(j: Judgement) -> bool:
    return (j.unseen_after or 0.0) > _WORSE * (j.unseen_before or 0.0)


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


# Tables of grids that are not judged as the grid `full` is.
_TABLES = {
    "deleted": _deleted, "foreign": _foreign, "machines": _machines,
    "short": _short, "constants": _short,
}  # fmt: skip
