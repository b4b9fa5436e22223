"""All verdicts of a proving ground together: what was to be reached, and what was."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, TypeVar

from mopro.benchmark.grid import LASER
from mopro.benchmark.judge import FAILED, FAMILY, GOOD, NONE, PARTLY, RIGHT, UNEXPLAINED, WRONG
from mopro.benchmark.judge import Judgement as J
from mopro.benchmark.sizes import BELOW

_CLEAR = 20.0
OUTCOMES = (RIGHT, FAMILY, PARTLY, WRONG, NONE, UNEXPLAINED, FAILED)
_LIMIT = 1.1
# What a proposed experiment promises to part by so many σ it should part.
_PARTED = 6.0

T = TypeVar("T")


@dataclass(frozen=True)
class Line:
    """One line of the table: of `count` cases, `reached`; `met` None without a case."""

    what: str
    target: str
    count: int
    reached: str
    met: bool | None


@dataclass(frozen=True)
class Rival:
    """An effect that cannot be told from what is hidden, and by how many σ it should be."""

    truth: str
    name: str
    sigma: float


@dataclass(frozen=True)
class Followed:
    """An ambiguous answer, and the one after the experiment that it proposed was run.

    `promised` are the σ by which that was to part each two effects of a family (`pair`).
    """

    before: J
    promised: Mapping[str, float]
    after: J

    @property
    def named(self) -> bool:
        return self.after.outcome == RIGHT and self.after.verdict == "named"

    @property
    def within_reach(self) -> bool:
        """Whether every rival was to be parted from what is hidden."""
        rivals = self.rivals()
        return bool(rivals) and all(rival.sigma >= _PARTED for rival in rivals)

    def gone(self) -> list[bool]:
        """For each rival that was to be parted from what is hidden, whether it is.

        None is if the answer is a wrong one.
        """
        left = [set(names.split("/")) for names in self.after.said]
        return [
            self.after.good and not any({rival.truth, rival.name} <= family for family in left)
            for rival in self.rivals()
            if rival.sigma >= _PARTED
        ]

    def rivals(self) -> list[Rival]:
        """What stands in one family with what is hidden."""
        families = [set(names.split("/")) for names in self.before.said]
        return [
            Rival(truth, name, self.promised.get(pair(truth, name), 0.0))
            for truth in self.before.truth
            for family in families
            if truth in family
            for name in sorted(family - {truth})
        ]


def pair(one: str, other: str) -> str:
    """Two effects in either order."""
    return " / ".join(sorted((one, other)))


@dataclass(frozen=True)
class Score:
    """The judgements, what came of the experiments proposed, and the table."""

    cases: tuple[J, ...]
    followed: tuple[Followed, ...]

    def lines(self) -> list[Line]:
        """The table of targets."""
        return [*_names(self.cases), *_several(self.cases), *_figures(self), *_follow(self)]

    def wrong(self) -> list[J]:
        """Every case with a name that is not in its data."""
        return [j for j in self.cases if j.outcome == WRONG or (j.group == "none" and j.said)]

    def confusion(self) -> dict[str, Counter[str]]:
        """For each single effect (or none), how often each outcome came."""
        table: dict[str, Counter[str]] = {}
        for j in self.cases:
            if len(j.truth) <= 1:
                truth = j.truth[0] if j.truth else j.group
                table.setdefault(truth, Counter())[_cell(j)] += 1
        return dict(sorted(table.items()))

    def as_json(self) -> dict[str, Any]:
        return {
            "table": [asdict(line) for line in self.lines()],
            "confusion": {truth: dict(cells) for truth, cells in self.confusion().items()},
            "cases": [asdict(j) for j in self.cases],
            "followed": [asdict(f) for f in self.followed],
        }


def _cell(j: J) -> str:
    return f"{WRONG}: {', '.join(j.said)}" if j.outcome == WRONG else j.outcome


def _single(cases: Sequence[J], low: float, high: float = float("inf")) -> list[J]:
    return [j for j in cases if len(j.truth) == 1 and low <= j.least_sigma < high]


def _names(cases: Sequence[J]) -> list[Line]:
    clear, faint = _single(cases, _CLEAR), _single(cases, BELOW, _CLEAR)
    below = _single(cases, 0.0, BELOW)
    null = [j for j in cases if j.group == "none"]
    seen = [*clear, *faint]
    return [
        _share("one effect, 20 σ or more: right name or family", clear, 0.98, lambda j: j.good),
        _share("one effect, 8 to 20 σ: right name or family", faint, 0.85, lambda j: j.good),
        _share("one effect, 8 σ or more: a wrong name", seen, 0.01, _is_wrong, most=True),
        _share("one effect below 8 σ: no wrong name", below, 0.99, lambda j: not _is_wrong(j)),
        _share("nothing hidden: none", null, 0.99, lambda j: j.verdict == NONE),
    ]


def _is_wrong(j: J) -> bool:
    return j.outcome == WRONG


def _several(cases: Sequence[J]) -> list[Line]:
    lines = []
    for count, name, target in ((2, "two effects", 0.92), (3, "three effects", 0.75)):
        chosen = [j for j in cases if len(j.truth) == count and j.least_sigma >= _CLEAR]
        lines.append(
            _share(f"{name}, each 20 σ or more: all right", chosen, target, lambda j: j.good)
        )
    strange = [j for j in cases if j.group == "off catalogue"]
    lines.append(
        _share(
            "off the catalogue: unexplained and described", strange, 0.90,
            lambda j: j.verdict == UNEXPLAINED and j.described,
        )
    )  # fmt: skip
    return lines


def _figures(score: Score) -> list[Line]:
    cases = score.cases
    main = [c.inside for j in cases for c in j.covered if c.main]
    every = [c.inside for j in cases for c in j.covered]
    named = [j for j in cases if j.truth and j.outcome in GOOD and j.gap_after is not None]
    timed = [j for j in cases if j.sensor == LASER and j.group != "alike"]
    long = [j.seconds for j in timed if j.seconds is not None]
    share = sum(main) / len(main) if main else 0.0
    low = f"median {median(long):.1f} s, worst {max(long):.1f} s" if long else "-"
    met = median(long) <= 20 and max(long) <= 90 if long else None
    return [
        Line("95 % intervals of the size hold the truth", "90 to 99 %", len(main),
             _percent(sum(main), len(main)), 0.90 <= share <= 0.99 if main else None),
        Line("95 % intervals of all parameters", "-", len(every),
             _percent(sum(every), len(every)), None),
        _share("held-out gap after, at most 1.1 × noise", named, 1.0,
               lambda j: (j.gap_after or 0.0) <= _LIMIT),
        Line("gap before → after, median (worst after), × noise", "-", len(named),
             _gaps(named), None),
        Line("time of a case with the laser", "median ≤ 20 s, worst ≤ 90 s", len(long), low, met),
    ]  # fmt: skip


def _gaps(named: Sequence[J]) -> str:
    if not named:
        return "-"
    before = median(j.gap_before or 0.0 for j in named)
    after = [j.gap_after or 0.0 for j in named]
    return f"{before:.2f} → {median(after):.3f} ({max(after):.3f})"


def _follow(score: Score) -> Iterator[Line]:
    """All ambiguous answers; those that a program could settle; and each rival by itself."""
    followed = score.followed
    reach = [f for f in followed if f.within_reach]
    gone = [gone for f in followed for gone in f.gone()]
    named = sum(f.named for f in followed)
    yield Line(
        "ambiguous, proposed experiment (if any) then run: named", "-", len(followed),
        _percent(named, len(followed)), None,
    )  # fmt: skip
    yield _share(
        f"… of which every rival was to be parted from the truth by {_PARTED:g} σ: named",
        reach, 0.90, lambda f: f.named,
    )  # fmt: skip
    yield _share(
        f"… rivals that were to be parted from the truth by {_PARTED:g} σ: gone",
        gone, 0.90, lambda g: g,
    )  # fmt: skip


def _share(
    what: str, cases: Sequence[T], target: float, holds: Callable[[T], bool], most: bool = False
) -> Line:
    count = sum(map(holds, cases))
    share = count / len(cases) if cases else 0.0
    met = (share <= target if most else share >= target) if cases else None
    sign = "≤" if most else "≥"
    return Line(what, f"{sign} {target:.0%}", len(cases), _percent(count, len(cases)), met)


def _percent(count: int, of: int) -> str:
    return f"{count / of:.1%} ({count} of {of})" if of else "-"
