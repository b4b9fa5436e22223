"""Sets of effects by their signatures alone: what a fit would come to if nothing bent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.model import Floats, Settings
from mopro.diagnosis.residual import projected_out
from mopro.diagnosis.signature import Scored, resized

# Of the sets of one size, so many are enlarged.
_KEPT = 30
# A size that its range cuts by more than this is no size of that effect.
_CUT = 0.05
_PARALLEL = 1e-9

Price = Callable[[Sequence[Scored]], float]


@dataclass(frozen=True)
class Sketch:
    """Candidates that go together, the settings to start a fit from, and the promised cost."""

    members: tuple[Scored, ...]
    start: Settings
    cost: float


class Sketcher:
    """Weighs sets of candidates beside a fit, from the products of their signatures."""

    def __init__(self, base: Fit, tangent: Floats, scored: Sequence[Scored]) -> None:
        self._base = base
        self._scored = [s for s in scored if s.group and s.starts]
        ends = np.cumsum([0, *(len(s.group) for s in self._scored)])
        self._columns = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
        changes = [np.zeros((len(base.residual), 0))]
        changes += [probe.change[:, None] for s in self._scored for probe in s.group]
        apart = projected_out(tangent, np.hstack(changes))
        self._gram = apart.T @ apart
        self._against = apart.T @ base.residual

    def sets(self, most: int, price: Price) -> list[Sketch]:
        """Sets of up to `most` candidates, the cheapest first.

        `price` is what a set costs besides its misfit. Larger sets grow from the best
        smaller ones.
        """
        found: list[Sketch] = []
        grown: list[tuple[int, ...]] = [(i,) for i in range(len(self._scored))]
        for _ in range(most):
            weighed = [(sketch, rows) for rows in grown if (sketch := self._sketch(rows, price))]
            weighed.sort(key=lambda pair: pair[0].cost)
            found += [sketch for sketch, _ in weighed[:_KEPT]]
            grown = list(self._larger([rows for _, rows in weighed[:_KEPT]]))
        return sorted(found, key=lambda sketch: sketch.cost)

    def _larger(self, sets: Sequence[tuple[int, ...]]) -> Iterator[tuple[int, ...]]:
        names = [s.candidate.name for s in self._scored]
        seen: set[tuple[int, ...]] = set()
        for rows in sets:
            taken = {names[i] for i in rows}
            for i, name in enumerate(names):
                more = tuple(sorted((*rows, i)))
                if name not in taken and more not in seen:
                    seen.add(more)
                    yield more

    def _sketch(self, rows: tuple[int, ...], price: Price) -> Sketch | None:
        """The set at its best sizes; None if no sizes are best, or they are out of range."""
        at = np.concatenate([self._columns[i] for i in rows])
        sizes = _solved(self._gram[np.ix_(at, at)], self._against[at])
        if sizes is None:
            return None
        members = tuple(self._scored[i] for i in rows)
        start = _start(members, sizes)
        if start is None:
            return None
        left = self._base.rss - float(self._against[at] @ sizes)
        return Sketch(members, start, self._base.misfit_of(left) + price(members))


def _solved(gram: Floats, against: Floats) -> Floats | None:
    """The least-squares sizes, or None where signatures are parallel."""
    scale = np.sqrt(np.diag(gram))
    if not scale.all():
        return None
    unit = gram / np.outer(scale, scale)
    if np.linalg.eigvalsh(unit)[0] < _PARALLEL:
        return None
    sizes: Floats = np.linalg.solve(unit, against / scale) / scale
    return sizes


def _start(members: Sequence[Scored], sizes: Floats) -> Settings | None:
    """The settings that `sizes` of the members' probes come to, if their ranges allow them."""
    settings: dict[str, dict[str, float]] = {}
    end = 0
    for s in members:
        own = sizes[end : end + len(s.group)]
        end += len(s.group)
        values, allowed = resized(s.candidate, s.group, own)
        if np.abs(allowed - own).max() > _CUT * np.abs(own).max():
            return None
        settings |= s.candidate.settings(values)
    return settings


def distinct(sketches: Sequence[Sketch], most: int) -> list[Sketch]:
    """The first `most` that are not the same but for twins."""
    chosen: list[Sketch] = []
    for sketch in sketches:
        if len(chosen) < most and not any(_alike(sketch, other) for other in chosen):
            chosen.append(sketch)
    return chosen


def _alike(one: Sketch, other: Sketch) -> bool:
    """Whether each member of one is, or is a twin of, a member of the other."""
    if len(one.members) != len(other.members):
        return False
    return all(
        any(a.candidate.key == b.candidate.key or a.twin_of(b) for b in other.members)
        for a in one.members
    )
