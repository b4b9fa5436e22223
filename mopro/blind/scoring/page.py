"""Markdown report of a benchmark's score; its tables can be read as plain text, too."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mopro.blind.scoring.judge import Judgement
from mopro.blind.scoring.score import OUTCOMES, FollowUp, Score


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
