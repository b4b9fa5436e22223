"""Search for the shapes of a term of the measurement: where on a grid it takes most away.

For any kind of machine: a residual comes with the names that a formula has at its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from mopro.engine.candidate import Parameter, ResidualView, Role
from mopro.engine.spectrum import position_spectrum
from mopro.formula.columns import Columns, Sampled
from mopro.formula.evaluate import Floats
from mopro.formula.written import WrittenEffect

# Points of a grid along a shape, twice as many along one that may be 0; along a period so many for
# each cycle in the span, and most of them where no spectrum of the residual tells the likely ones.
GRID = 12
_OVERSAMPLED, _MOST_PERIODS = 5, 3000
# Lines of the spectrum about which periods are tried, as these and as harmonics up to this order,
# and slow cycles in the span, which leak into each other and are all tried. Doubled, a search takes
# twice as long; halved, a weak harmonic may come after lines that no period explains.
_LINES, _HARMONICS, _SLOW_CYCLES = 12, 4, 12
# Most points of the grid of all shapes together.
_MOST_POINTS = 20_000
# Share of a column's power below which it is taken to depend on the others.
_DEPENDENT = 1e-9


class Search:
    """Finds starts of a candidate in a residual, by least squares at each point of a grid.

    `longest`: the span that a period is looked for in, as a multiple of the longest one. `samples`:
    the series of a fit. `columns`: those of this effect and other forms of it, which share them.
    """

    def __init__(
        self,
        effect: WrittenEffect,
        parameters: tuple[Parameter, ...],
        longest: float,
        samples: Callable[[ResidualView], Sequence[Sampled]],
        columns: Columns | None = None,
    ) -> None:
        self._columns = columns or Columns([effect])
        self._places = self._columns.places(effect)
        self._effect, self._parameters, self._samples = effect, parameters, samples
        self._shapes = [p for p in parameters if p.role is not Role.AMPLITUDE]
        self._sizes = [p for p in parameters if p.role is Role.AMPLITUDE]
        self._longest = longest
        self._factors = {p.name: p.factor for p in effect.parameters}

    def __call__(self, view: ResidualView) -> Iterator[Mapping[str, float]]:
        every = self._samples(view)
        axes = [self._along(p, every) for p in self._shapes]
        best: tuple[float, dict[str, float]] = (0.0, {})
        for points in self._points(axes):
            gram, product = self._columns.sums(points, every)
            own = self._places
            gains, sizes = _solved(gram[:, own][:, :, own], product[:, own])
            at = int(np.argmax(gains))
            if gains[at] > best[0]:
                found = {name: float(values[at]) for name, values in points.items()}
                for p, size in zip(self._sizes, sizes[at].tolist(), strict=True):
                    found[p.name] = p.within(size)
                best = float(gains[at]), found
        if best[1]:
            # A search must not begin where the effect is off.
            first = self._sizes[0]
            if best[1][first.name] == first.null and first.starts:
                best[1][first.name] = first.starts[0]
            yield {p.name: best[1][p.name] for p in self._parameters}

    def _points(self, axes: Sequence[Floats]) -> Iterator[dict[str, Floats]]:
        """The grid of all shapes, in batches: an array for each shape."""
        flat = [axis.ravel()[:_MOST_POINTS] for axis in np.meshgrid(*axes, indexing="ij")]
        batch = self._columns.batch
        for begin in range(0, len(flat[0]), batch):
            cut = slice(begin, begin + batch)
            yield {p.name: own[cut] for p, own in zip(self._shapes, flat, strict=True)}

    def _along(self, p: Parameter, every: Sequence[Sampled]) -> Floats:
        if p.inverse:
            step = self._longest / (_OVERSAMPLED * p.high)
            seen = self._seen(p, every)
            if seen:
                rates = self._likely(p, step, *seen)
            else:
                count = int((1 / p.low - 1 / p.high) / step) + 2
                rates = np.linspace(1 / p.high, 1 / p.low, min(count, _MOST_PERIODS))
            return 1 / rates
        if p.low > 0:
            return np.geomspace(p.low, p.high, GRID)
        return np.linspace(p.low, p.high, 2 * GRID)

    def _seen(
        self, p: Parameter, every: Sequence[Sampled]
    ) -> tuple[list[Floats], list[Floats]] | None:
        """The signal that a term repeats in, in the unit of its period, and what is left there.

        None for a term of several signals, of which the residual need not have lines.
        """
        signals = self._effect.term.formula.names - self._factors.keys()
        signal = min(signals, default="")
        if len(signals) > 1 or any(np.ndim(s.names.get(signal, 0.0)) != 1 for s in every):
            return None
        shown = [s for s in every if s.factor]
        if not shown:
            return None
        places = [np.asarray(s.names[signal])[s.rows] / self._factors[p.name] for s in shown]
        return places, [s.residual for s in shown]

    @staticmethod
    def _likely(
        p: Parameter, step: float, places: Sequence[Floats], left: Sequence[Floats]
    ) -> Floats:
        """Rates (1 / period), `step` apart near lines of the spectrum, and all slow ones."""
        low, high = 1 / p.high, 1 / p.low
        tried = [low + step * np.arange(_OVERSAMPLED * _SLOW_CYCLES)]
        rates, power = position_spectrum(places, left, p.low)
        inner = power[1:-1]
        peaks = 1 + np.flatnonzero((inner > power[:-2]) & (inner >= power[2:]))
        lines = rates[peaks[np.argsort(power[peaks])[-_LINES:]]]
        near = step * np.arange(-(_OVERSAMPLED // 2), _OVERSAMPLED // 2 + 1)
        # A harmonic that is the strongest line is met as well as a fundamental.
        tried += [(lines[:, None] + near) / order for order in range(1, _HARMONICS + 1)]
        return np.unique(np.clip(np.concatenate([each.ravel() for each in tried]), low, high))


def _solved(gram: Floats, product: Floats) -> tuple[Floats, Floats]:
    """Fall of chi-squared at each point (points,), with the sizes there (points x sizes).

    `gram`: points x sizes x sizes, `product`: points x sizes.
    """
    powers = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    normal = gram + _DEPENDENT * np.maximum(powers, 1e-300) * np.eye(gram.shape[1])
    sizes = np.linalg.solve(normal, product[:, :, None])[:, :, 0]
    gains = np.einsum("gi,gi->g", product, sizes)
    return np.nan_to_num(gains, nan=0.0), sizes
