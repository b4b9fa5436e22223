"""Subsets of candidates in the linear approximation: normal equations of their signatures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.model import Floats, Settings
from mopro.diagnosis.residual import projected_out
from mopro.diagnosis.signature import ScoreTest, resized
from mopro.diagnosis.ties import lowest_first

# Subsets of each size from which larger ones are grown. Doubled, the search is twice as wide; it
# costs no simulation.
_BEAM_WIDTH = 30
# Share of its size by which the range of an amplitude may cut it before the subset is left out.
_MOST_CUT = 0.05
# Smallest eigenvalue of the normalised normal matrix: below it signatures are parallel.
_PARALLEL = 1e-9

# Predicted EBIC of a subset, less its deviance.
Penalty = Callable[[Sequence[ScoreTest]], float]


@dataclass(frozen=True)
class LinearSubset:
    """Candidates to add together, the settings to start their fit from, and the predicted EBIC."""

    members: tuple[ScoreTest, ...]
    start: Settings
    ebic: float


class LinearSubsets:
    """Evaluates subsets of candidates beside a fit, from the Gram matrix of their signatures.

    `tangent` is an orthonormal basis of the Jacobian of `base`, which is projected out.
    """

    def __init__(self, base: Fit, tangent: Floats, scores: Sequence[ScoreTest]) -> None:
        self._base = base
        self._scores = [s for s in scores if s.group and s.starts]
        ends = np.cumsum([0, *(len(s.group) for s in self._scores)])
        self._columns = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
        changes = [np.zeros((len(base.residual), 0))]
        changes += [probe.change[:, None] for s in self._scores for probe in s.group]
        apart = projected_out(tangent, np.hstack(changes))
        self._gram = apart.T @ apart
        self._with_residual = apart.T @ base.residual

    def best(self, most: int, penalty: Penalty) -> list[LinearSubset]:
        """Subsets of up to `most` candidates, the lowest predicted EBIC first.

        A beam search: larger subsets grow from the best smaller ones.
        """
        subsets: list[tuple[LinearSubset, tuple[int, ...]]] = []
        rows_of_size: list[tuple[int, ...]] = [(i,) for i in range(len(self._scores))]
        for _ in range(most):
            evaluated = [
                (subset, rows) for rows in rows_of_size if (subset := self._subset(rows, penalty))
            ]
            beam = _in_order(evaluated)[:_BEAM_WIDTH]
            subsets += beam
            rows_of_size = list(self._larger([rows for _, rows in beam]))
        return [subset for subset, _ in _in_order(subsets)]

    def _larger(self, subsets: Sequence[tuple[int, ...]]) -> Iterator[tuple[int, ...]]:
        """Each of the subsets with one more candidate of another name, without repeats."""
        names = [s.candidate.name for s in self._scores]
        seen: set[tuple[int, ...]] = set()
        for rows in subsets:
            taken = {names[i] for i in rows}
            for i, name in enumerate(names):
                more = tuple(sorted((*rows, i)))
                if name not in taken and more not in seen:
                    seen.add(more)
                    yield more

    def _subset(self, rows: tuple[int, ...], penalty: Penalty) -> LinearSubset | None:
        """The subset at its least-squares sizes; None if those do not exist or are out of range."""
        at = np.concatenate([self._columns[i] for i in rows])
        sizes = _solved(self._gram[np.ix_(at, at)], self._with_residual[at])
        if sizes is None:
            return None
        members = tuple(self._scores[i] for i in rows)
        start = _start(members, sizes)
        if start is None:
            return None
        rss = self._base.rss - float(self._with_residual[at] @ sizes)
        return LinearSubset(members, start, self._base.deviance_of(rss) + penalty(members))


def _in_order(
    subsets: Sequence[tuple[LinearSubset, tuple[int, ...]]],
) -> list[tuple[LinearSubset, tuple[int, ...]]]:
    """Subsets with their rows, the lowest predicted EBIC first."""
    return lowest_first(subsets, lambda pair: pair[0].ebic, lambda pair: pair[1])


def _solved(gram: Floats, with_residual: Floats) -> Floats | None:
    """Solution of the normal equations, or None where signatures are parallel."""
    scale = np.sqrt(np.diag(gram))
    if not scale.all():
        return None
    unit = gram / np.outer(scale, scale)
    if np.linalg.eigvalsh(unit)[0] < _PARALLEL:
        return None
    sizes: Floats = np.linalg.solve(unit, with_residual / scale) / scale
    return sizes


def _start(members: Sequence[ScoreTest], sizes: Floats) -> Settings | None:
    """The settings at `sizes` times the members' probes, or None if their ranges forbid them."""
    settings: dict[str, dict[str, float]] = {}
    end = 0
    for s in members:
        own = sizes[end : end + len(s.group)]
        end += len(s.group)
        values, allowed = resized(s.candidate, s.group, own)
        if np.abs(allowed - own).max() > _MOST_CUT * np.abs(own).max():
            return None
        settings |= s.candidate.settings(values)
    return settings


def distinct(subsets: Sequence[LinearSubset], most: int) -> list[LinearSubset]:
    """The first `most` subsets, leaving out those that differ from an earlier one by twins."""
    chosen: list[LinearSubset] = []
    for subset in subsets:
        if len(chosen) < most and not any(_equivalent(subset, other) for other in chosen):
            chosen.append(subset)
    return chosen


def _equivalent(one: LinearSubset, other: LinearSubset) -> bool:
    """True if each member of one is, or is a twin of, a member of the other."""
    if len(one.members) != len(other.members):
        return False
    return all(
        any(a.candidate.key == b.candidate.key or a.twin_of(b) for b in other.members)
        for a in one.members
    )
