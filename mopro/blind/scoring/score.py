"""Score of a benchmark: all judgements, as tables in JSON and as a report in Markdown.

The tables of the report can be read as plain text, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mopro.blind.scoring.judge import FollowUp, Judgement
from mopro.blind.scoring.outcome import FAILED, FAMILY, NONE, PARTLY, RIGHT, UNEXPLAINED, WRONG
from mopro.blind.scoring.statistic_rows import TableRow, rows_of

OUTCOMES = (RIGHT, FAMILY, PARTLY, WRONG, NONE, UNEXPLAINED, FAILED)


@dataclass(frozen=True)
class Score:
    """All judgements and follow-ups of a benchmark."""

    cases: tuple[Judgement, ...]
    followed: tuple[FollowUp, ...]
    grid: str = ""

    def rows(self) -> list[TableRow]:
        """The table of statistics of the grid; that of the grid `full` if it has none."""
        return list(rows_of(self.grid, self.cases, self.followed))

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


# -- the report ---------------------------------------------------------------------------------


def page(score: Score) -> str:
    """The report: statistics and targets, outcomes, wrong names, missed effects, follow-ups."""
    parts = [
        _table(
            ("", "target", "cases", "reached", "met"),
            ((x.what, x.target, str(x.count), x.reached, _mark(x.met)) for x in score.rows()),
        ),
        "Outcomes of cases with one effect or none:\n",
        _confusion(score),
    ]
    if wrong := score.wrong():
        parts += ["Wrong names:\n", _cases(wrong)]
    if missed := [j for j in score.cases if not j.good and j not in wrong]:
        parts += ["Effects missed:\n", _cases(missed)]
    if score.followed:
        parts += ["After the proposed experiment:\n", _followed(score.followed)]
    return "\n".join(parts)


def _mark(met: bool | None) -> str:
    return "" if met is None else ("yes" if met else "no")


def _confusion(score: Score) -> str:
    rows = []
    for truth, cells in score.confusion().items():
        counts = [str(cells[name] or "") for name in OUTCOMES if name != "wrong"]
        others = [
            f"{cell.removeprefix('wrong: ')} ({n})"
            for cell, n in cells.items()
            if cell.startswith("wrong: ")
        ]
        rows.append((truth, *counts, "; ".join(others)))
    heads = ("truth", *(name for name in OUTCOMES if name != "wrong"), "wrong names")
    return _table(heads, rows)


def _cases(cases: Iterable[Judgement]) -> str:
    rows = (
        (
            j.number, j.group, j.sensor, " + ".join(j.truth) or "-",
            f"{j.least_sigma:.0f}", j.verdict, ", ".join(j.said) or j.note or "-",
            "-" if j.leaves is None else f"{j.leaves:.0f}",
        )
        for j in cases
    )  # fmt: skip
    heads = ("case", "group", "sensor", "truth", "least σ", "verdict", "named", "leaves χ²")
    return _table(heads, rows)


def _followed(cases: Iterable[FollowUp]) -> str:
    rows = (
        (
            f.before.number, f.before.sensor, " + ".join(f.before.truth), ", ".join(f.before.said),
            ", ".join(f"{a.name} {a.sigma:.2g}" for a in f.alternatives()) or "-",
            ", ".join(f.after.said) or f.after.note or f.after.verdict,
        )
        for f in cases
    )  # fmt: skip
    heads = ("case", "sensor", "truth", "named", "predicted difference, σ", "named afterwards")
    return _table(heads, rows)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)
