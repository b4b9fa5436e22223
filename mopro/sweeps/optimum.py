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
from mopro.sweeps.figures import OK
from mopro.sweeps.tasks import Chunk, Row, Subject, rows_of
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
    """The figure in `column` as small as can be, or as large, with all `bounds` kept."""

    column: str
    largest: bool
    bounds: tuple[Bound, ...] = ()

    def cost(self, row: dict[str, Any]) -> float:
        """What is made least: the figure, or more for a run that fails or misses a bound."""
        figure = row[self.column]
        if row["outcome"] != OK or figure is None:
            return _FAILED
        missed = sum(bound.missed_by(row[bound.column]) for bound in self.bounds)
        if missed:
            return _NOT_KEPT * (1 + missed)
        return -figure if self.largest else float(figure)


@dataclass(frozen=True)
class Optimum:
    """The best row that was found, of so many runs; `kept` is false if it misses a bound."""

    row: dict[str, Any]
    runs: int
    kept: bool


def optimum(
    subject: Subject,
    goal: Goal,
    runs: int,
    seed: int = 0,
    told: Callable[[int, int], None] = lambda done, total: None,
) -> Optimum:
    """The best point of what is varied, by at most `runs` runs, or a generation if that is more.

    The same for the same `seed`. `told` hears of the runs done and of the most there may be.
    """
    from scipy.optimize import differential_evolution

    known: dict[str, Row] = {}

    def cost(shares: Sequence[float]) -> float:
        values = tuple(
            each.at(min(share, _LARGEST_SHARE))
            for each, share in zip(subject.varied, shares, strict=True)
        )
        (task,) = subject.tasks([values])
        if task.name not in known:
            (known[task.name],) = rows_of(Chunk(subject, (task,), True))
            told(len(known), runs)
        return goal.cost(cells(known[task.name]))

    def cells(row: Row) -> dict[str, Any]:
        return dict(zip(subject.columns, row, strict=True))

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
    best = min(map(cells, known.values()), key=goal.cost)
    return Optimum(best, len(known), goal.cost(best) < _NOT_KEPT)
