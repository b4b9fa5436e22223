"""Least-squares fit of a set of effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mopro.engine.assumed import FIT_TOLERANCE, LEAST_SHARE, REPEATS
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.fits.descent import Descent
from mopro.engine.fits.jacobian import SecantJacobian, gauss_newton_step
from mopro.engine.fits.limit import NO_LIMIT, Limit
from mopro.engine.residuals import Residuals, projected_out
from mopro.engine.series import Floats, Settings

# Shares of each series that are fitted one after another where the whole one misleads: each is
# twice the one before, so that an oscillation which the last one fits is off by less than a cycle.
_GROWING = tuple(2.0**-halvings for halvings in range(REPEATS, 0, -1))

# A set of effects in their forms.
Key = frozenset[tuple[str, str]]
# A fit of such a set, told from a better one by its sum of squares.
Identity = tuple[Key, float]


@dataclass(frozen=True)
class Fit:
    """Effects fitted together, and with them the free numbers of the model itself.

    `candidates`: the effects, without `base`. `order`: effect and parameter of each column of
    `jacobian`, those of the base first. `residual`: whitened, nuisances projected out
    (samples). `jacobian`: its derivative (samples x parameters, per unit of each). `count`:
    samples less nuisances. `searched`: number of parameters that a search found and least
    squares did not fit. `abandoned`: the fit was given up, mostly before its minimum, as it
    could not come near the limit asked for.
    """

    candidates: tuple[Candidate, ...]
    base: tuple[Candidate, ...]
    order: tuple[tuple[str, Parameter], ...]
    settings: Settings
    residual: Floats
    jacobian: Floats
    count: int
    searched: int = 0
    abandoned: bool = False

    @property
    def names(self) -> frozenset[str]:
        return frozenset(candidate.name for candidate in self.candidates)

    @property
    def laws(self) -> frozenset[str]:
        """The names of its free-form terms."""
        return frozenset(candidate.name for candidate in self.candidates if candidate.law)

    @property
    def key(self) -> Key:
        return frozenset(candidate.key for candidate in self.candidates)

    @property
    def chosen(self) -> int:
        """Number of its parameters that were fitted or searched for, without assumed constants."""
        return self.searched + sum(p.role is not Role.CONSTANT for _, p in self.order)

    @property
    def identity(self) -> Identity:
        return self.key, self.rss

    @property
    def far_from_linear(self) -> bool:
        """True if noise is so small a share of the residual (RMS) that signatures may mislead."""
        return self.rss * LEAST_SHARE**2 > self.count

    @property
    def values(self) -> Floats:
        return np.array([self.settings[effect][p.name] for effect, p in self.order])

    @cached_property
    def rss(self) -> float:
        """Sum of squares of the whitened residual: chi-squared where the noise is known."""
        return float(self.residual @ self.residual)

    @cached_property
    def tangent(self) -> Floats:
        """Orthonormal basis (samples x parameters) of the Jacobian."""
        basis, _ = np.linalg.qr(self.jacobian)
        return np.asarray(basis)

    @cached_property
    def adapted(self) -> Floats:
        """The residual (samples) once all parameters have adapted, to first order."""
        return projected_out(self.tangent, self.residual)

    def settings_without(self, names: frozenset[str]) -> Settings:
        """The settings, the effects `names` off and the others as they are."""
        return {effect: v for effect, v in self.settings.items() if effect not in names}

    def linear_part(self, name: str) -> Floats:
        """Change of the residual (samples) if the effect `name` were off, to first order."""
        off = [
            p.to_null(value) if effect == name and p.role is Role.AMPLITUDE else 0.0
            for (effect, p), value in zip(self.order, self.values.tolist(), strict=True)
        ]
        return np.asarray(self.jacobian @ off)

    def residual_without(self, name: str) -> Floats:
        """The residual (samples) if `name` were off and the others adapted, to first order."""
        own = np.array([effect == name for effect, _ in self.order], dtype=bool)
        others, change = self.jacobian[:, ~own], self.linear_part(name)
        return np.asarray(self.residual + change + others @ gauss_newton_step(others, change))

    def stepped_without(self, name: str) -> Settings:
        """Settings of the other effects if `name` were off: one Gauss-Newton step."""
        own = np.array([effect == name for effect, _ in self.order], dtype=bool)
        moved = {effect: dict(values) for effect, values in self.settings.items() if effect != name}
        steps = gauss_newton_step(self.jacobian[:, ~own], self.linear_part(name)).tolist()
        others = (entry for entry, mine in zip(self.order, own, strict=True) if not mine)
        for (effect, p), step in zip(others, steps, strict=True):
            moved[effect][p.name] = p.within(moved[effect][p.name] + step)
        return moved


def least_squares_fit(
    residuals: Residuals,
    candidates: Sequence[Candidate],
    starts: Sequence[Settings],
    limit: Limit = NO_LIMIT,
    base: Sequence[Candidate] = (),
) -> Fit:
    """The best fit of `candidates` and `base` from any of `starts`, each parameter in its range.

    A start has a value for every parameter, which is moved into its range; those that are searched
    keep it. A fit that cannot come down to `limit` is `abandoned`.
    """
    problems = [_Problem(residuals, candidates, base, start) for start in starts]
    return min((problem.solve(limit) for problem in problems), key=lambda fit: fit.rss)


def growing_fit(
    residuals: Residuals,
    candidates: Sequence[Candidate],
    start: Settings,
    limit: Limit,
    base: Sequence[Candidate],
) -> Fit:
    """As `least_squares_fit`, after fits of the beginning of each series, longer every time.

    The prediction of a model that runs freely from a start state gets out of phase with the
    data; the sum of squares over the whole of it then has many local minima.
    """
    for share in _GROWING:
        part = residuals.subset(residuals.beginnings(share))
        start = least_squares_fit(part, candidates, [start], base=base).settings
    return least_squares_fit(residuals, candidates, [start], limit, base)


def explained_by(residuals: Residuals, fit: Fit, name: str) -> float:
    """Whitened sum of squares that the effect `name` takes away, no free-form term reshaped.

    Free to take another shape, such as a period, a term would fill the place of the effect.
    """
    others = [_in_its_shape(c) if c.law else c for c in fit.candidates if c.name != name]
    start = fit.settings_without(frozenset({name}))
    return least_squares_fit(residuals, others, [start], base=fit.base).rss - fit.rss


def _in_its_shape(candidate: Candidate) -> Candidate:
    kept = (
        replace(p, role=Role.SEARCHED) if p.role is Role.SHAPE else p for p in candidate.parameters
    )
    return replace(candidate, parameters=tuple(kept))


def with_central_jacobian(residuals: Residuals, fit: Fit) -> Fit:
    """`fit` with its Jacobian by central differences, as errors of its parameters need it.

    What differences to one side miss looks like information on what the data do not tell.
    """
    problem = _Problem(residuals, fit.candidates, fit.base, fit.settings)
    return replace(fit, jacobian=problem.central_jacobian(fit.residual)) if fit.order else fit


class _Problem:
    """Least squares from one start, in parameters scaled to their ranges."""

    def __init__(
        self,
        residuals: Residuals,
        candidates: Sequence[Candidate],
        base: Sequence[Candidate],
        start: Settings,
    ) -> None:
        self._residuals = residuals
        self._candidates, self._base = tuple(candidates), tuple(base)
        self._all = (*self._base, *self._candidates)
        parameters = [(c.name, p) for c in self._all for p in c.parameters]
        self._order = tuple((n, p) for n, p in parameters if p.role is not Role.SEARCHED)
        self._searched = len(parameters) - len(self._order)
        self._start = start
        # Whoever found the start, a fit begins inside of the ranges.
        values = [p.within(start[name][p.name]) for name, p in self._order]
        self._begun = [(p.scaled(v), v) for (_, p), v in zip(self._order, values, strict=True)]
        self._last: tuple[tuple[float, ...], Floats] | None = None

    def solve(self, limit: Limit) -> Fit:
        scaled = np.array([share for share, _ in self._begun])
        low, high = self._box()
        if not self._order:
            residual = self._residual(scaled)
            return self._fit(scaled, residual, np.zeros((len(residual), 0)))
        differences = [p.difference for _, p in self._order]
        parts = [self._residuals.part(p.run) for _, p in self._order]
        descent = Descent(self._residual, differences, limit, parts, self._change)
        tolerance = FIT_TOLERANCE / max(self._residuals.count, 1)
        reached = descent.run(scaled, low, high, tolerance)
        fit = self._fit(reached.x, reached.residual, reached.jacobian)
        return replace(fit, abandoned=descent.abandoned)

    def central_jacobian(self, residual: Floats) -> Floats:
        """Jacobian (samples x parameters) at the start, where it leaves `residual`.

        By differences to one side only within a step of an end of a range.
        """
        scaled = np.array([share for share, _ in self._begun])
        steps = np.array([p.difference for _, p in self._order])
        low, high = self._box()
        outwards = np.where(np.minimum(scaled - low, high - scaled) > steps, -steps, steps)
        parts = [self._residuals.part(p.run) for _, p in self._order]
        sides = [
            SecantJacobian(self._residual, differences.tolist(), parts, self._change).at(scaled)
            for differences in (steps, outwards)
        ]
        return self._fit(scaled, residual, (sides[0] + sides[1]) / 2).jacobian

    def _box(self) -> tuple[Floats, Floats]:
        """Lower and upper ends of the scaled parameters; an angle may go once around either way."""
        turns = np.array([1.0 if p.role is Role.PHASE else 0.0 for _, p in self._order])
        return -turns, 1 + turns

    def _fit(self, scaled: Floats, residual: Floats, jacobian: Floats) -> Fit:
        values = self._values(scaled.tolist())
        slopes = [p.slope(s) for (_, p), s in zip(self._order, scaled.tolist(), strict=True)]
        return Fit(
            candidates=self._candidates,
            base=self._base,
            order=self._order,
            settings=self._settings(
                [p.within(v) for (_, p), v in zip(self._order, values, strict=True)]
            ),
            residual=residual,
            jacobian=jacobian / np.array(slopes) if slopes else jacobian,
            count=self._residuals.count,
            searched=self._searched,
        )

    def _settings(self, values: Sequence[float]) -> Settings:
        settings: dict[str, dict[str, float]] = {
            c.name: {**c.fixed, **_searched_values(c, self._start)} for c in self._all
        }
        for (effect, parameter), value in zip(self._order, values, strict=True):
            settings[effect][parameter.name] = float(value)
        return settings

    def _values(self, scaled: Sequence[float]) -> list[float]:
        """Values of the parameters in `order`; those that the fit began with have the same bits.

        What was simulated there, before the fit began, is known.
        """
        parameters = zip(self._order, self._begun, scaled, strict=True)
        return [v if s == first else p.value(s) for (_, p), (first, v), s in parameters]

    def _residual(self, scaled: Floats) -> Floats:
        """The residual; the last one is stored, as the solver asks for its Jacobian next."""
        point = tuple(scaled.tolist())
        if self._last is None or self._last[0] != point:
            self._last = point, self._residuals.at(self._settings(self._values(point)))
        return self._last[1]

    def _change(self, x: Floats, moved: Floats) -> Floats:
        """Change of the residual between two points."""
        before, after = (self._settings(self._values(p.tolist())) for p in (x, moved))
        return self._residuals.change(before, after)


def _searched_values(candidate: Candidate, start: Settings) -> Mapping[str, float]:
    names = [p.name for p in candidate.parameters if p.role is Role.SEARCHED]
    return {name: start[candidate.name][name] for name in names}
