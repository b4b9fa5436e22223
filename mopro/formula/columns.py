"""The columns that sizes of a term have in a fit to a residual: one for each point of a grid.

Forms of one effect that are searched for in one residual have most columns in common.
"""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock

import numpy as np
from cachetools import LRUCache
from numpy.typing import NDArray

from mopro.engine.series import RUN_AWAY, unless_run_away
from mopro.formula.angles import Angles
from mopro.formula.evaluate import Floats, Values, evaluate, over_grid
from mopro.formula.expressions import Formula, factor_beside, without_products
from mopro.formula.written import AMPLITUDE, EffectParameter, WrittenEffect

# Values of columns that are computed at once: they stay in the processor's cache.
_AT_ONCE = 100_000
# A sum of squares that one value has run away in.
_SQUARE_RUN_AWAY = RUN_AWAY**2 / 4
# Bytes of sums that are kept for the other forms.
_KEPT_BYTES = 4 << 20
# Gram matrices (points x columns x columns), and products with the residual (points x columns).
Sums = tuple[Floats, Floats]
Points = Mapping[str, Floats]


@dataclass(frozen=True)
class Sampled:
    """The samples of one series, and the names of formulas in its run.

    `names`: numbers, or arrays (run's rows,) in SI, at the times `time_s`. `rows` (n,): those of
    the samples. `residual` (n,): in standard deviations `sigma` of the noise. `factor`: what a term
    of 1 (SI) comes to in the unit of the readings; 0 where they do not show it. `is_aligned`: the
    mean of the readings tells nothing.
    """

    names: Mapping[str, Floats | float]
    time_s: Floats
    rows: NDArray[np.intp]
    residual: Floats = field(repr=False)
    sigma: float
    factor: float
    is_aligned: bool

    def key(self, names: Iterable[str]) -> Hashable:
        """What columns of formulas with these names are worked out from, and the residual."""
        known = [np.asarray(self.names[n]) for n in names if n in self.names]
        arrays = _digest([*known, self.time_s, self.rows, self.residual])
        return arrays, self.sigma, self.factor, self.is_aligned


@dataclass(frozen=True)
class _Column:
    """`formula` with the values `own` of the sizes, times `scale`: the change by a unit of one."""

    formula: Formula
    own: tuple[tuple[str, float], ...]
    scale: float

    @staticmethod
    def of(form: WrittenEffect, p: EffectParameter) -> _Column:
        sizes = sorted(q.name for q in form.parameters if q.role == AMPLITUDE)
        # Of a wave with harmonics, one of them.
        alone = without_products(form.term.formula, {*sizes} - {p.name})
        factor = factor_beside(alone, p.name)
        if factor is not None and not factor.names.intersection(sizes):
            return _Column(factor, (), p.factor)
        return _Column(alone, tuple((n, p.factor if n == p.name else 0.0) for n in sizes), 1.0)


class Columns:
    """The columns of all sizes of some forms, which have the same shapes."""

    def __init__(self, forms: Sequence[WrittenEffect]) -> None:
        every = [(form, p) for form in forms for p in form.parameters]
        self._factors = {p.name: p.factor for _, p in every}
        made = dict.fromkeys(_Column.of(form, p) for form, p in every if p.role == AMPLITUDE)
        self._columns = list(made)
        self._scales = np.array([column.scale for column in made])
        names = frozenset[str]().union(*(c.formula.names for c in made))
        self._names = sorted(names - self._factors.keys())
        self._angles = Angles.of([c.formula for c in made])
        # Asked by several threads at once.
        self._lock = Lock()
        self._kept: LRUCache[Hashable, Sums] = LRUCache(_KEPT_BYTES, _bytes_of)

    def places(self, form: WrittenEffect) -> list[int]:
        """Where the columns of the sizes of a form are among all."""
        sizes = (p for p in form.parameters if p.role == AMPLITUDE)
        return [self._columns.index(_Column.of(form, p)) for p in sizes]

    @property
    def batch(self) -> int:
        """Most points whose sums are asked for together: they can be kept."""
        count = len(self._columns)
        return max(1, _KEPT_BYTES // (8 * count * (count + 1)))

    def sums(self, points: Points, every: Sequence[Sampled]) -> Sums:
        """Those of all columns at the `points` (points,) of the shapes, in their units.

        A column is the whitened change of all readings for one unit of its size.
        """
        shapes = {name: values * self._factors[name] for name, values in points.items()}
        key = _digest(shapes.values()), tuple(sampled.key(self._names) for sampled in every)
        with self._lock:
            if key not in self._kept:
                self._kept[key] = self._summed(shapes, every)
            return self._kept[key]

    def _at_rows(self, sampled: Sampled) -> dict[str, Floats | float]:
        own = {name: sampled.names[name] for name in self._names if name in sampled.names}
        return {n: np.asarray(v)[None, sampled.rows] if np.ndim(v) else v for n, v in own.items()}

    def _summed(self, shapes: Points, every: Sequence[Sampled]) -> Sums:
        count, sizes = len(next(iter(shapes.values()))), len(self._columns)
        gram, product = np.zeros((count, sizes, sizes)), np.zeros((count, sizes))
        for sampled in every:
            if not sampled.factor:
                continue
            names = self._at_rows(sampled)
            step = max(1, _AT_ONCE // max(1, len(sampled.rows) * sizes))
            for begin in range(0, count, step):
                cut = slice(begin, begin + step)
                at = {name: values[cut] for name, values in shapes.items()}
                own, beside = self._of_block(sampled, names, at)
                gram[cut] += own
                product[cut] += beside
        return gram, product

    def _of_block(self, sampled: Sampled, names: Values, shapes: Points) -> Sums:
        """Sums over the samples of one series."""
        with np.errstate(all="ignore"):
            known = {**names, **_along_rows(shapes)}
            known |= self._angles.values(known)
            columns = self._terms(self._angles.formulas, sampled, known, shapes)
            if sampled.is_aligned:
                columns -= columns.mean(axis=2, keepdims=True)
            gram = columns @ columns.transpose(0, 2, 1)
        if (np.trace(gram, axis1=1, axis2=2) < _SQUARE_RUN_AWAY).all():
            scales = self._scales * (sampled.factor / sampled.sigma)
            return gram * np.outer(scales, scales), columns @ sampled.residual * scales
        columns = self._whitened(sampled, names, shapes)
        return columns @ columns.transpose(0, 2, 1), columns @ sampled.residual

    def _whitened(self, sampled: Sampled, names: Values, shapes: Points) -> Floats:
        """The columns at the samples of one series (points x sizes x samples).

        0 where a term has no value, or has run away: it changes nothing there.
        """
        formulas = [column.formula for column in self._columns]
        with np.errstate(all="ignore"):
            terms = self._terms(formulas, sampled, {**names, **_along_rows(shapes)}, shapes)
        columns = unless_run_away(terms * self._scales[:, None]) * sampled.factor
        if sampled.is_aligned:
            columns = columns - columns.mean(axis=2, keepdims=True)
        return np.nan_to_num(columns / sampled.sigma)

    def _terms(
        self, formulas: Sequence[Formula], sampled: Sampled, known: Values, shapes: Points
    ) -> Floats:
        """The values (points x sizes x samples) of the formulas of all columns."""
        count = len(next(iter(shapes.values())))
        found = np.empty((count, len(self._columns), len(sampled.rows)))
        for nth, (column, formula) in enumerate(zip(self._columns, formulas, strict=True)):
            if not formula.of_signals:
                found[:, nth] = over_grid(formula, {**known, **dict(column.own)})
                continue
            for point in range(count):
                own = {name: float(values[point]) for name, values in shapes.items()}
                whole = {**sampled.names, **dict(column.own), **own}
                found[point, nth] = evaluate(formula, whole, sampled.time_s)[sampled.rows]
        return found


def _along_rows(shapes: Points) -> dict[str, Floats | float]:
    return {name: values[:, None] for name, values in shapes.items()}


def _digest(arrays: Iterable[NDArray[np.generic]]) -> bytes:
    """A key of the contents of some arrays, which does not keep them."""
    made = hashlib.sha256()
    for array in arrays:
        made.update(repr((array.dtype.str, array.shape)).encode())
        made.update(array.tobytes())
    return made.digest()


def _bytes_of(sums: Sums) -> int:
    return sums[0].nbytes + sums[1].nbytes
