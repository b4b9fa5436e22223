"""Search for the shapes of a term of the measurement: where on a grid it takes most away."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mopro.engine.candidate import Parameter, ResidualView, Role
from mopro.engine.spectrum import position_spectrum
from mopro.formula.evaluate import Floats, evaluate, over_grid
from mopro.formula.language import without_products
from mopro.formula.written import WrittenEffect
from mopro.stated.data import Reading, Run
from mopro.stated.simulation import Known, Model, term_of

# Points of a grid along a shape, twice as many along one that may be 0; along a period so many for
# each cycle in the span, and most of them where no spectrum of the residual tells the likely ones.
GRID = 12
_OVERSAMPLED, _MOST_PERIODS = 5, 3000
# Lines of the spectrum about which periods are tried, as these and as harmonics up to this order,
# and slow cycles in the span, which leak into each other and are all tried. Doubled, a search takes
# twice as long; halved, a weak harmonic may come after lines that no period explains.
_LINES, _HARMONICS, _SLOW_CYCLES = 12, 4, 12
# Values that are computed at once, and most points of the grid of all shapes together.
_AT_ONCE, _MOST_POINTS = 2_000_000, 20_000
# Share of a column's power below which it is taken to depend on the others.
_DEPENDENT = 1e-9


class Search:
    """Finds starts of a candidate in a residual, by least squares at each point of a grid.

    `longest`: the span that a period is looked for in, as a multiple of the longest one.
    """

    def __init__(
        self, model: Model, effect: WrittenEffect, parameters: tuple[Parameter, ...], longest: float
    ) -> None:
        self._model, self._effect, self._parameters = model, effect, parameters
        self._shapes = [p for p in parameters if p.role is not Role.AMPLITUDE]
        self._sizes = [p for p in parameters if p.role is Role.AMPLITUDE]
        self._longest = longest
        self._factors = {p.name: p.factor for p in effect.parameters}
        # Of a wave with harmonics, the one whose size is not 0.
        sizes = {p.name for p in self._sizes}
        self._alone = {
            name: without_products(effect.term.formula, sizes - {name}) for name in sizes
        }

    def __call__(self, view: ResidualView) -> Iterator[Mapping[str, float]]:
        left = np.concatenate(list(view.residuals))
        known = self._known(view)
        axes = [self._along(p, known, view) for p in self._shapes]
        best: tuple[float, dict[str, float]] = (0.0, {})
        for points in self._points(axes, len(left)):
            gains, sizes = self._gains(points, known, view, left)
            at = int(np.argmax(gains))
            if gains[at] > best[0]:
                found = {name: float(own[at]) for name, own in points.items()}
                for p, size in zip(self._sizes, sizes[at].tolist(), strict=True):
                    found[p.name] = p.within(size)
                best = float(gains[at]), found
        if best[1]:
            # A search must not begin where the effect is off.
            first = self._sizes[0]
            if best[1][first.name] == first.null and first.starts:
                best[1][first.name] = first.starts[0]
            yield {p.name: best[1][p.name] for p in self._parameters}

    def _points(self, axes: Sequence[Floats], samples: int) -> Iterator[dict[str, Floats]]:
        """The grid of all shapes, in batches: an array for each shape."""
        flat = [axis.ravel()[:_MOST_POINTS] for axis in np.meshgrid(*axes, indexing="ij")]
        batch = max(1, _AT_ONCE // (samples * max(len(self._sizes), 1)))
        if self._effect.term.formula.of_signals:
            batch = 1
        for begin in range(0, len(flat[0]), batch):
            cut = slice(begin, begin + batch)
            yield {p.name: own[cut] for p, own in zip(self._shapes, flat, strict=True)}

    def _along(self, p: Parameter, known: Sequence[Known], view: ResidualView) -> Floats:
        if p.inverse:
            step = self._longest / (_OVERSAMPLED * p.high)
            seen = self._seen(p, known, view)
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
        self, p: Parameter, known: Sequence[Known], view: ResidualView
    ) -> tuple[list[Floats], list[Floats]] | None:
        """The signal that a term repeats in, in the unit of its period, and what is left there.

        None for a term of several signals, of which the residual need not have lines.
        """
        signals = self._effect.term.formula.names - self._factors.keys()
        signal = min(signals, default="")
        if len(signals) > 1 or any(np.ndim(names.get(signal, 0.0)) != 1 for names in known):
            return None
        trials = zip(self._model.experiment.trials, known, strict=True)
        every = [(run, names, reading) for run, names in trials for reading in run.readings]
        places, left = [], []
        for (run, names, reading), own in zip(every, view.residuals, strict=True):
            if self._is_shown(run, reading):
                places.append(np.asarray(names[signal])[reading.rows] / self._factors[p.name])
                left.append(own)
        return (places, left) if places else None

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

    def _is_shown(self, run: Run, reading: Reading) -> bool:
        shown = self._model.shows(self._effect, reading.sensor)
        return shown and self._effect.name not in run.without

    def _known(self, view: ResidualView) -> list[Known]:
        """The names of each run at the settings of a fit."""
        model = self._model
        return [
            {**model.values_in(run, view.settings), **model.values(view.settings)}
            for run in model.experiment.trials
        ]

    def _gains(
        self, points: Mapping[str, Floats], known: Sequence[Known], view: ResidualView, left: Floats
    ) -> tuple[Floats, Floats]:
        """Fall of chi-squared at each point (points,), with the sizes there (points x sizes)."""
        columns = np.stack([self._column(p, points, known, view) for p in self._sizes], axis=2)
        normal = np.einsum("gni,gnj->gij", columns, columns, optimize=True)
        product = np.einsum("gni,n->gi", columns, left, optimize=True)
        powers = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        normal = normal + _DEPENDENT * np.maximum(powers, 1e-300) * np.eye(len(self._sizes))
        sizes = np.linalg.solve(normal, product[:, :, None])[:, :, 0]
        gains = np.einsum("gi,gi->g", product, sizes)
        return np.nan_to_num(gains, nan=0.0), sizes

    def _column(
        self, size: Parameter, points: Mapping[str, Floats], known: Sequence[Known],
        view: ResidualView,
    ) -> Floats:  # fmt: skip
        """Whitened change of all readings for one unit of a size (points x samples)."""
        own = dict.fromkeys(self._factors, 0.0) | {size.name: self._factors[size.name]}
        shapes = {name: values * self._factors[name] for name, values in points.items()}
        blocks: list[Floats] = []
        for run, names in zip(self._model.experiment.trials, known, strict=True):
            for reading in run.readings:
                sigma = view.sigmas[len(blocks)]
                blocks.append(self._block(run, reading, names, own, shapes, size.name) / sigma)
        return np.nan_to_num(np.concatenate(blocks, axis=1))

    def _block(
        self, run: Run, reading: Reading, names: Known, own: Mapping[str, float],
        shapes: Mapping[str, Floats], size: str,
    ) -> Floats:  # fmt: skip
        sensor, effect, count = reading.sensor, self._effect, len(next(iter(shapes.values())))
        if not self._is_shown(run, reading):
            return np.zeros((count, len(reading.rows)))
        read = {"y": evaluate(sensor.reads.formula, names, run.time_s)}
        if effect.term.formula.of_signals:
            shaped = {name: float(values[0]) for name, values in shapes.items()}
            term = term_of(effect, {**own, **shaped}, {**names, **read}, run.time_s)
            term = term[None, reading.rows]
        else:
            rows = {
                name: np.asarray(v)[None, reading.rows] if np.ndim(v) else v
                for name, v in {**names, **read}.items()
            }
            grid = {name: values[:, None] for name, values in shapes.items()}
            shape = (count, len(reading.rows))
            term = over_grid(self._alone[size], {**rows, **own, **grid}, shape)
        term = term * ((sensor.sign or 1) * (sensor.scale or 1.0) / sensor.factor)
        return term - term.mean(axis=1, keepdims=True) if sensor.zero is None else term
