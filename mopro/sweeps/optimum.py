"""Search for the point of a sweep at which a figure is best, and others keep their bounds.

By differential evolution (Storn and Price 1997) of scipy: a figure that jumps where a run begins
to stall has no slope to follow. It asks for one run at a time, which are those of a sweep.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mopro.errors import MoproError
from mopro.sweeps.drawn import VERIFIED, Draws
from mopro.sweeps.figures import OK
from mopro.sweeps.summary import CONFIDENCE, Share, summary
from mopro.sweeps.targets import Value
from mopro.sweeps.tasks import Chunk, Subject, rows_of
from mopro.units import parse_quantity, units_of

# What can be asked for: the column, and the dimension of its numbers.
FIGURES = {
    "time": ("time_s", "time"),
    "margin": ("force_margin", "ratio"),
    "lag": ("largest_lag_m", "length"),
    "settling": ("settling_s", "time"),
    "energy": ("coil_energy_J", "energy"),
    "temperature": ("hour_temperature_C", "temperature"),
}
_KEEP = re.compile(r"\s*([a-z]+)\s*([<>])=?\s*(.+)")
# Beyond all figures: the cost of a run that does not keep a bound, and of one that fails.
_NOT_KEPT, _FAILED = 1e12, 1e15
# Members of a generation for each quantity, scipy's own number.
_MEMBERS = 15
# The generation's costs are this much alike at the end, as a share of them.
_ALIKE = 1e-3
_LARGEST_SHARE = 1 - 1e-9
# Points that are verified, the best of them first.
_MOST_TRIED = 8


class GoalError(MoproError):
    """A goal or a bound that cannot be read; its text says what was expected."""

    rule = "bad-goal"


def column_of(figure: str) -> str:
    """The column of a figure's name; GoalError for another name."""
    if figure not in FIGURES:
        raise GoalError(f"'{figure}' is no figure of a run: expected one of {', '.join(FIGURES)}")
    return FIGURES[figure][0]


@dataclass(frozen=True)
class Bound:
    """A bound that a figure keeps: `margin>0.2`, `lag<50um`; the value is in SI."""

    text: str
    column: str
    above: bool
    value: float

    @classmethod
    def read(cls, text: str) -> Bound:
        """Raises GoalError."""
        match = _KEEP.fullmatch(text)
        if match is None:
            raise GoalError(f"'{text}': expected a figure and its bound, such as margin>0.2")
        column, dimension = column_of(match[1]), FIGURES[match[1]][1]
        try:
            value = parse_quantity(match[3], dimension, units_of(dimension)[0])
        except ValueError as error:
            raise GoalError(f"'{text}': {error}") from error
        return cls(text, column, match[2] == ">", value)

    def missed_by(self, figure: float | None) -> float:
        """By how much `figure` misses the bound, as a share of it; 0 if it keeps it."""
        if figure is None:
            return 1.0
        kept = (operator.ge if self.above else operator.le)(figure, self.value)
        return 0.0 if kept else abs(figure - self.value) / (abs(self.value) or 1.0)


@dataclass(frozen=True)
class Goal:
    """The figure in `column` as small as can be, or as large, with all `bounds` kept.

    Of drawn machines at most the share `risk` may stall, fail or miss a bound.
    """

    column: str
    largest: bool
    bounds: tuple[Bound, ...] = ()
    risk: float = 0.003

    def cost(self, rows: Sequence[dict[str, Any]]) -> float:
        """Objective that is minimised: the figure of the first row, of the machine as stated.

        It is more for a run that fails or misses a bound, and where too many of the other rows,
        those of drawn machines, do.
        """
        row, figure = rows[0], rows[0][self.column]
        if row["outcome"] != OK or figure is None:
            return _FAILED
        if missed := self._missed_by(row):
            return _NOT_KEPT * (1 + missed)
        if len(rows) > 1 and (share := self.missing(rows)).observed > self.risk:
            return _NOT_KEPT * (1 + share.observed)
        return -figure if self.largest else float(figure)

    def missing(self, rows: Sequence[dict[str, Any]]) -> Share:
        """The drawn machines that fail or miss a bound, of the rows of a point."""
        drawn = rows[1:]
        lost = sum(row["outcome"] != OK or self._missed_by(row) > 0 for row in drawn)
        return Share(lost, len(drawn))

    def _missed_by(self, row: dict[str, Any]) -> float:
        return sum(bound.missed_by(row[bound.column]) for bound in self.bounds)


@dataclass(frozen=True)
class Verified:
    """Share of freshly drawn machines that miss a bound at the best point, of those `tried`.

    `at_most`: the bound on their share, with the confidence of 95 % for all tries together.
    """

    missing: Share
    tried: int

    @property
    def at_most(self) -> float:
        return self.missing.at_most(1 - (1 - CONFIDENCE) / _MOST_TRIED)


@dataclass(frozen=True)
class Optimum:
    """The best row that was found, of so many runs; `kept` is false if it misses a bound.

    `values`: those of what is varied. `verified` by fresh draws where machines are drawn.
    """

    row: dict[str, Any]
    values: tuple[Value, ...]
    runs: int
    kept: bool
    verified: Verified | None = None


class _Known:
    """The rows of the points that were asked for, each run once.

    Drawn machines are run only where the machine as stated keeps all bounds.
    """

    def __init__(self, subject: Subject, goal: Goal, machines: Sequence[tuple[Value, ...]]) -> None:
        self.points: dict[tuple[Value, ...], list[dict[str, Any]]] = {}
        self._subject = subject
        self._goal = goal
        self._machines = machines

    def rows(self, values: tuple[Value, ...]) -> list[dict[str, Any]]:
        if values not in self.points:
            stated, *drawn = self._machines
            rows = _run(self._subject, values, [stated])
            if drawn and self._goal.cost(rows) < _NOT_KEPT:
                rows += _run(self._subject, values, drawn)
            self.points[values] = rows
        return self.points[values]


def _run(
    subject: Subject, values: tuple[Value, ...], machines: Sequence[tuple[Value, ...]]
) -> list[dict[str, Any]]:
    """The rows of a point on each of `machines`."""
    tasks = tuple(subject.tasks([(*values, *machine) for machine in machines]))
    return [subject.cells(row) for row in rows_of(Chunk(subject, tasks, True))]


def optimum(
    subject: Subject,
    goal: Goal,
    runs: int,
    seed: int = 0,
    told: Callable[[int, int], None] = lambda done, total: None,
    draws: Draws | None = None,
) -> Optimum:
    """The best point of what is varied, at most `runs` points, or a generation if that is more.

    With `draws`, each point is run on the machine as stated and on those drawn, which are the same
    at all points; the best is verified on fresh ones. The same for the same `seed`. `told` hears of
    the points done and of the most there may be.
    """
    from scipy.optimize import differential_evolution

    machines = [()] if draws is None else draws.machines(subject.uncertain)
    known = _Known(subject, goal, machines)

    def cost(shares: Sequence[float]) -> float:
        values = tuple(
            each.at(min(share, _LARGEST_SHARE))
            for each, share in zip(subject.varied, shares, strict=True)
        )
        found = goal.cost(known.rows(values))
        told(min(len(known.points), runs), runs)
        return found

    dimensions = len(subject.varied)
    differential_evolution(
        cost,
        [(0.0, 1.0)] * dimensions,
        maxiter=max(runs // (_MEMBERS * dimensions) - 1, 0),
        popsize=_MEMBERS,
        tol=_ALIKE,
        rng=seed,
        polish=False,
    )
    costs = {values: goal.cost(rows) for values, rows in known.points.items()}
    best = sorted(costs, key=costs.__getitem__)
    kept = [values for values in best if costs[values] < _NOT_KEPT]
    if draws is None or not kept:
        return Optimum(known.rows(best[0])[0], best[0], len(costs), bool(kept))
    values, verified = _verified(subject, goal, kept, draws)
    row = summary(known.rows(values), draws)
    return Optimum(row, values, len(costs), verified.at_most <= goal.risk, verified)


def _verified(
    subject: Subject, goal: Goal, kept: Sequence[tuple[Value, ...]], draws: Draws
) -> tuple[tuple[Value, ...], Verified]:
    """The best point, of those that are `kept` by the search, that fresh machines bear out.

    The search prefers points that its own draws flatter, so the best may fail: others are tried,
    each twice as far down as the one before. If none is borne out it is the one with fewest misses.
    """
    fresh = draws.enough_for(goal.risk, 1 - (1 - CONFIDENCE) / _MOST_TRIED)
    found = list[tuple[tuple[Value, ...], Verified]]()
    for nth in range(_MOST_TRIED):
        values = kept[min(2**nth, len(kept)) - 1]
        machines = fresh.machines(subject.uncertain, VERIFIED + nth)
        verified = Verified(goal.missing(_run(subject, values, machines)), nth + 1)
        found.append((values, verified))
        if verified.at_most <= goal.risk or 2**nth >= len(kept):
            break
    return min(found, key=lambda each: each[1].at_most)
