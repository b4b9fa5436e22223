"""Statistics of all judgements of a benchmark, each with its target."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from mopro.blind.cases.spec import LASER
from mopro.blind.making.sizes import RESOLUTION_SIGMA
from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.outcome import (
    FAILED,
    FAMILY,
    GOOD,
    NONE,
    PARTLY,
    RIGHT,
    UNEXPLAINED,
    WRONG,
)
from mopro.blind.scoring.rows import CLEAR_SIGMA, TableRow, percent, share
from mopro.blind.scoring.rows_machines import machines_rows
from mopro.blind.scoring.rows_short import short_rows


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


OUTCOMES = (RIGHT, FAMILY, PARTLY, WRONG, NONE, UNEXPLAINED, FAILED)
_LARGEST_RESIDUAL = 1.1  # held-out rms over the noise, at most
# A proposed experiment predicted to separate two effects by this much should distinguish them.
_DISTINGUISHED_SIGMA = 6.0


# Tables of grids that are not judged as the grid `full` is.
_TABLES = {
    "deleted": deleted_rows, "foreign": foreign_rows, "machines": machines_rows,
    "short": short_rows, "constants": short_rows,
}  # fmt: skip


@dataclass(frozen=True)
class Alternative:
    """An effect `name` that the verdict cannot distinguish from the hidden effect `truth`.

    `sigma` is the difference of the two that the proposed experiment is predicted to show.
    """

    truth: str
    name: str
    sigma: float


@dataclass(frozen=True)
class FollowUp:
    """An ambiguous case, judged `before` and `after` its proposed experiment was run.

    `promised` is the predicted difference (σ) of each two effects of a family, by `pair_key`.
    """

    before: Judgement
    promised: Mapping[str, float]
    after: Judgement

    @property
    def named(self) -> bool:
        """Each hidden effect is named and no family is left."""
        return self.after.outcome == RIGHT and self.after.verdict == "named"

    @property
    def all_distinguishable(self) -> bool:
        """The prediction for each alternative is at least 6 σ, and there is an alternative."""
        alternatives = self.alternatives()
        return bool(alternatives) and all(a.sigma >= _DISTINGUISHED_SIGMA for a in alternatives)

    def excluded(self) -> list[bool]:
        """For each alternative predicted to differ by 6 σ: whether it is excluded afterwards.

        A wrong verdict excludes none.
        """
        families = [set(names.split("/")) for names in self.after.said]
        return [
            self.after.good and not any({a.truth, a.name} <= family for family in families)
            for a in self.alternatives()
            if a.sigma >= _DISTINGUISHED_SIGMA
        ]

    def alternatives(self) -> list[Alternative]:
        """The other effects of each family that holds a hidden effect."""
        families = [set(names.split("/")) for names in self.before.said]
        return [
            Alternative(truth, name, self.promised.get(pair_key(truth, name), 0.0))
            for truth in self.before.truth
            for family in families
            if truth in family
            for name in sorted(family - {truth})
        ]


def pair_key(one: str, other: str) -> str:
    """Key of two effects, the same in either order."""
    return " / ".join(sorted((one, other)))


@dataclass(frozen=True)
class Score:
    """All judgements and follow-ups of a benchmark."""

    cases: tuple[Judgement, ...]
    followed: tuple[FollowUp, ...]
    grid: str = ""

    def rows(self) -> list[TableRow]:
        """The table of statistics of the grid; that of the grid `full` if it has none."""
        if self.grid in _TABLES:
            return [*_TABLES[self.grid](self.cases), _times(self.cases, self.grid)]
        return [
            *_single_effects(self.cases),
            *_other_groups(self.cases),
            *_intervals(self.cases),
            *_residuals(self.cases),
            _times(self.cases),
            *_follow_ups(self.followed),
        ]

    def wrong(self) -> list[Judgement]:
        """Every case with a name that is not in its data."""
        return [j for j in self.cases if j.outcome == WRONG or (j.group == "none" and j.said)]

    def confusion(self) -> dict[str, Counter[str]]:
        """Counts of outcomes for each single effect, and for the groups without an effect."""
        table: dict[str, Counter[str]] = {}
        for j in self.cases:
            if len(j.truth) <= 1:
                truth = j.truth[0] if j.truth else j.group
                table.setdefault(truth, Counter())[_confusion_cell(j)] += 1
        return dict(sorted(table.items()))

    def as_json(self) -> dict[str, Any]:
        """The score as `mopro blind score --json` prints it."""
        return {
            "table": [asdict(row) for row in self.rows()],
            "confusion": {truth: dict(cells) for truth, cells in self.confusion().items()},
            "cases": [asdict(j) for j in self.cases],
            "followed": [asdict(f) for f in self.followed],
        }


def _confusion_cell(j: Judgement) -> str:
    return f"{WRONG}: {', '.join(j.said)}" if j.outcome == WRONG else j.outcome


def _single(cases: Sequence[Judgement], low: float, high: float = float("inf")) -> list[Judgement]:
    """Cases with one hidden effect of a size in [low, high) σ."""
    return [j for j in cases if len(j.truth) == 1 and low <= j.least_sigma < high]


def _single_effects(cases: Sequence[Judgement]) -> list[TableRow]:
    clear = _single(cases, CLEAR_SIGMA)
    faint = _single(cases, RESOLUTION_SIGMA, CLEAR_SIGMA)
    below = _single(cases, 0.0, RESOLUTION_SIGMA)
    null = [j for j in cases if j.group == "none"]
    seen = [*clear, *faint]
    return [
        share("one effect, 20 σ or more: right name or family", clear, 0.98, lambda j: j.good),
        share("one effect, 8 to 20 σ: right name or family", faint, 0.85, lambda j: j.good),
        share("one effect, 8 σ or more: a wrong name", seen, 0.01, _is_wrong, at_most=True),
        share("one effect below 8 σ: no wrong name", below, 0.99, lambda j: not _is_wrong(j)),
        share("nothing hidden: none", null, 0.99, lambda j: j.verdict == NONE),
    ]


def _is_wrong(j: Judgement) -> bool:
    return j.outcome == WRONG


def _other_groups(cases: Sequence[Judgement]) -> Iterator[TableRow]:
    for count, name, target in ((2, "two effects", 0.92), (3, "three effects", 0.75)):
        several = [j for j in cases if len(j.truth) == count and j.least_sigma >= CLEAR_SIGMA]
        what = f"{name}, each 20 σ or more: all right"
        yield share(what, several, target, lambda j: j.good)
    unknown = [j for j in cases if j.group == "off catalogue"]
    yield share(
        "off the catalogue: unexplained and described", unknown, 0.90,
        lambda j: j.verdict == UNEXPLAINED and j.described,
    )  # fmt: skip


def _intervals(cases: Sequence[Judgement]) -> list[TableRow]:
    sizes = [c.inside for j in cases for c in j.covered if c.main]
    every = [c.inside for j in cases for c in j.covered]
    met = 0.92 <= sum(sizes) / len(sizes) <= 0.98 if sizes else None
    return [
        TableRow("95 % intervals of the size that contain the true value", "92 to 98 %",
                 len(sizes), percent(sum(sizes), len(sizes)), met),
        TableRow("95 % intervals of all parameters that contain it", "-",
                 len(every), percent(sum(every), len(every)), None),
    ]  # fmt: skip


def _residuals(cases: Sequence[Judgement]) -> list[TableRow]:
    named = [j for j in cases if j.truth and j.outcome in GOOD and j.gap_after is not None]
    return [
        share("held-out residual after the fit, at most 1.1 × noise", named, 1.0,
               lambda j: (j.gap_after or 0.0) <= _LARGEST_RESIDUAL),
        TableRow("residual before → after, median (worst after), × noise", "-",
                 len(named), _median_residuals(named), None),
    ]  # fmt: skip


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
        percent(named, len(followed)), None,
    )  # fmt: skip
    yield share(
        f"the same, if each alternative was predicted to differ by {_DISTINGUISHED_SIGMA:g} σ",
        distinguishable, 0.90, lambda f: f.named,
    )  # fmt: skip
    yield share(
        f"alternatives predicted to differ by {_DISTINGUISHED_SIGMA:g} σ: excluded",
        excluded, 0.90, lambda e: e,
    )  # fmt: skip
