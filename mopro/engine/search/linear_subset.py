"""Subsets of candidates in the linear approximation: normal equations of their signatures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import FITTED, LEAST_SHARE, MOST_EFFECTS, ROUNDING
from mopro.engine.candidate import Candidate
from mopro.engine.fits import Evidence, Fit, Key, gauss_newton_step
from mopro.engine.residuals import projected_out
from mopro.engine.search.signature import ScoreTest, resized
from mopro.engine.series import Floats, Settings

# Subsets of each size from which larger ones are grown, and that are evaluated exactly. They
# cost no simulation.
_BEAM_WIDTH = FITTED * MOST_EFFECTS

Rows = tuple[int, ...]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class LinearSubset:
    """Candidates to add to `base`, the start of their fit, and the predicted EBIC.

    `sizes`: of the members' probes. `reduction`: predicted fall of the sum of squares.
    """

    base: Fit
    members: tuple[ScoreTest, ...]
    start: Settings
    sizes: Floats
    ebic: float
    reduction: float

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        return (*self.base.candidates, *(member.candidate for member in self.members))

    @property
    def names(self) -> frozenset[str]:
        return frozenset(candidate.name for candidate in self.candidates)

    @property
    def key(self) -> Key:
        return frozenset(candidate.key for candidate in self.candidates)

    @property
    def starts(self) -> list[Settings]:
        """The start, and one in which what is in `base` has adapted (a Gauss-Newton step)."""
        if not self.base.order:
            return [self.start]
        probes = [probe.change for member in self.members for probe in member.group]
        change = -np.column_stack(probes) @ self.sizes
        steps = gauss_newton_step(self.base.jacobian, change).tolist()
        adapted = {effect: dict(values) for effect, values in self.start.items()}
        for (effect, p), step in zip(self.base.order, steps, strict=True):
            adapted[effect][p.name] = p.within(adapted[effect][p.name] + step)
        return [self.start, adapted]


class LinearSubsets:
    """Subsets of candidates beside the fit `base`, from the Gram matrix of their signatures.

    The Jacobian of `base` is projected out, so that its effects may adapt. `evidence` is that
    of white noise.
    """

    def __init__(self, base: Fit, scores: Sequence[ScoreTest], evidence: Evidence) -> None:
        self._base, self._evidence = base, evidence
        self._scores = [s for s in scores if s.group]
        ends = np.cumsum([0, *(len(s.group) for s in self._scores)])
        self._columns = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
        changes = [probe.change for s in self._scores for probe in s.group]
        # One change after the other in memory, as they come.
        columns = np.array(changes).T if changes else np.zeros((len(base.residual), 0))
        apart = projected_out(base.tangent, columns)
        self._penalty, self._findings = evidence.penalty(base), evidence.findings(base)
        self._sums = evidence.noise.sums(base.residual)
        # By series, as those of unknown noise are judged each by itself.
        series = (*evidence.noise.starts, len(base.residual))
        parts = [slice(a, b) for a, b in pairwise(series)]
        self._grams = np.array([apart[p].T @ apart[p] for p in parts])
        self._products = np.array([apart[p].T @ base.residual[p] for p in parts])
        self._gram, self._product = self._grams.sum(axis=0), self._products.sum(axis=0)

    def best(self, most: int) -> list[LinearSubset]:
        """Subsets of up to `most` candidates, the lowest predicted EBIC first.

        A beam search: larger subsets grow from the best smaller ones.
        """
        found: list[LinearSubset] = []
        beam: dict[Rows, float] = {(): 0.0}
        noise = self._evidence.noise
        for _ in range(most):
            larger = self._larger(beam)
            valid = ((rows, s) for rows in larger if (s := self._subset(rows)))
            # Where the noise is known they come in the order of their EBIC.
            first = islice(valid, _BEAM_WIDTH) if noise.exact and all(noise.stated) else valid
            evaluated = sorted(first, key=lambda pair: pair[1].ebic)[:_BEAM_WIDTH]
            found += [subset for _, subset in evaluated]
            beam = {rows: subset.reduction for rows, subset in evaluated}
        return sorted(found, key=lambda subset: subset.ebic)

    def _larger(self, beam: Mapping[Rows, float]) -> list[Rows]:
        """The subsets of `beam` with one more candidate, of those that reduce the residual most.

        `beam`: the subsets and the reduction by each. In the order of the reduction by all members
        less the penalty of their parameters, the largest first.
        """
        names = [s.candidate.name for s in self._scores]
        penalties = [self._added_penalty([s]) for s in self._scores]
        net: dict[Rows, float] = {}
        for rows, so_far in beam.items():
            taken = {names[i] for i in rows}
            gains = self._gains(rows)
            order = sorted(range(len(names)), key=lambda i: penalties[i] - gains[i])
            for i in order[:_BEAM_WIDTH]:
                larger = tuple(sorted((*rows, i)))
                if names[i] not in taken and larger not in net:
                    members = [self._scores[j] for j in larger]
                    net[larger] = so_far + float(gains[i]) - self._added_penalty(members)
        return sorted(net, key=lambda rows: -net[rows])

    def _gains(self, rows: Rows) -> Floats:
        """Reduction of the sum of squares by each candidate beside those in `rows`."""
        at = self._at(rows)
        gram, product = self._gram, self._product
        if len(at):
            held = np.linalg.pinv(gram[np.ix_(at, at)], hermitian=True) @ gram[at]
            product = product - self._product[at] @ held
            gram = gram - gram[:, at] @ held
        left = np.diag(gram) > ROUNDING * np.diag(self._gram)
        single = np.where(left, product**2 / np.where(left, np.diag(gram), 1.0), 0.0)
        gains = np.empty(len(self._scores))
        for i, own in enumerate(self._columns):
            gain = float(single[own[0]])
            if len(own) > 1:
                own = own[left[own]]
                gain = float(product[own] @ np.linalg.pinv(gram[np.ix_(own, own)]) @ product[own])
            gains[i] = gain
        return gains

    def _added_penalty(self, members: Sequence[ScoreTest]) -> float:
        joined = [member.candidate for member in members]
        return self._evidence.of_joining(joined, self._base.count, self._findings)

    def _at(self, rows: Rows) -> Index:
        return np.concatenate([np.zeros(0, dtype=np.intp), *(self._columns[i] for i in rows)])

    def _subset(self, rows: Rows) -> LinearSubset | None:
        """The subset at its least-squares sizes; None if those do not exist or are out of range."""
        at = self._at(rows)
        sizes = _solved(self._gram[np.ix_(at, at)], self._product[at])
        if sizes is None:
            return None
        members = tuple(self._scores[i] for i in rows)
        start = _start(members, sizes)
        if start is None:
            return None
        own = np.einsum("i,sij,j->s", sizes, self._grams[:, at[:, None], at], sizes)
        change = own - 2 * self._products[:, at] @ sizes
        deviance = self._evidence.noise.of_sums(self._sums + change)
        penalty = self._penalty + self._added_penalty(members)
        settings = {**self._base.settings, **start}
        reduction = -float(change.sum())
        return LinearSubset(self._base, members, settings, sizes, deviance + penalty, reduction)


def _solved(gram: Floats, product: Floats) -> Floats | None:
    """Solution of the normal equations, or None where signatures are parallel."""
    scale = np.sqrt(np.diag(gram))
    if not scale.all():
        return None
    unit = gram / np.outer(scale, scale)
    if np.linalg.eigvalsh(unit)[0] < ROUNDING:
        return None
    sizes: Floats = np.linalg.solve(unit, product / scale) / scale
    return sizes


def _start(members: Sequence[ScoreTest], sizes: Floats) -> Settings | None:
    """The settings at `sizes` times the members' probes, or None if their ranges forbid them."""
    settings: dict[str, dict[str, float]] = {}
    end = 0
    for s in members:
        own = sizes[end : end + len(s.group)]
        end += len(s.group)
        values, allowed = resized(s.candidate, s.group, own)
        if np.abs(allowed - own).max() > LEAST_SHARE * np.abs(own).max():
            return None
        settings |= s.candidate.settings(values)
    return settings


def of_each_kind(subsets: Iterable[LinearSubset], most: int) -> list[LinearSubset]:
    """The first `most` subsets that explain different things, and all single effects like those.

    Single effects that signatures cannot tell apart are fitted, however many they are. Of larger
    sets that is left to the round that replaces the effect.
    """
    kinds, chosen = list[LinearSubset](), list[LinearSubset]()
    for subset in subsets:
        known = any(_alike(subset, other) for other in kinds)
        if not known and len(kinds) < most:
            kinds.append(subset)
        if kinds[-1] is subset or (known and len(subset.members) == 1):
            chosen.append(subset)
    return chosen


def _alike(one: LinearSubset, other: LinearSubset) -> bool:
    """True if they add to the same fit, and each member of one is in the other, or one like it."""
    if one.base.key != other.base.key or len(one.members) != len(other.members):
        return False
    return all(
        any(a.candidate.key == b.candidate.key or a.alike(b) for b in other.members)
        for a in one.members
    )
