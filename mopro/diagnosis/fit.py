"""Fits of a set of effects: least squares within plausible ranges, and what they are worth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy import optimize, stats

from mopro.diagnosis.model import Candidate, Floats, Parameter, Settings
from mopro.diagnosis.residual import Residuals

# A finite difference this share of a parameter's range is small against any curvature
# that a fit can follow, and large against an integrator's rounding.
_DIFFERENCE = 1e-4
_SCANNED = 25
_NEAR_BOUND = 1e-3
# A parameter that its range holds back speaks against its effect: odds of 150 to 1.
_BOUND_PRICE = 10.0


@dataclass(frozen=True)
class Fit:
    """Effects fitted together; `residual` is whitened, `jacobian` its derivative.

    Rows of `jacobian` are samples, columns the parameters in `order`.
    """

    candidates: tuple[Candidate, ...]
    order: tuple[tuple[str, Parameter], ...]
    values: Floats
    residual: Floats
    jacobian: Floats
    known_noise: bool
    count: int

    @property
    def names(self) -> frozenset[str]:
        return frozenset(candidate.name for candidate in self.candidates)

    @property
    def settings(self) -> Settings:
        return settings_of(self.order, self.values)

    @cached_property
    def rss(self) -> float:
        """Sum of squares of the whitened residual: chi-squared where the noise is known."""
        return float(self.residual @ self.residual)

    def cost(self, pool: int) -> float:
        """-2 log likelihood, and the price of each parameter and of having had `pool` choices.

        The extended Bayesian information criterion of Chen and Chen (2008): k ln n + 2 ln
        of the number of ways to choose so many effects.
        """
        n = max(self.count, 1)
        misfit = self.rss if self.known_noise else n * math.log(max(self.rss, 1e-300) / n)
        ways = math.comb(max(pool, len(self.candidates)), len(self.candidates))
        price = len(self.order) * math.log(n) + 2 * math.log(ways)
        return misfit + price + _BOUND_PRICE * len(self.at_bound())

    def intervals(self, level: float = 0.95) -> list[tuple[float, float]]:
        """Confidence intervals of the parameters, in `order`; infinite if not identifiable."""
        freedom = max(self.count - len(self.order), 1)
        variance = 1.0 if self.known_noise else self.rss / freedom
        quantile = stats.norm.ppf((1 + level) / 2)
        if not self.known_noise:
            quantile = stats.t.ppf((1 + level) / 2, freedom)
        spans = np.array([p.high - p.low for _, p in self.order])
        scaled = self.jacobian * spans
        try:
            covariance = np.linalg.inv(scaled.T @ scaled) * variance
        except np.linalg.LinAlgError:
            return [(-math.inf, math.inf)] * len(self.order)
        half = quantile * np.sqrt(np.maximum(np.diag(covariance), 0)) * spans
        return [(v - h, v + h) for v, h in zip(self.values, half, strict=True)]

    def at_bound(self) -> list[str]:
        """The parameters that the data would push out of their plausible range."""
        return [
            f"{effect}.{p.name}"
            for (effect, p), value in zip(self.order, self.values, strict=True)
            if min(value - p.low, p.high - value) < _NEAR_BOUND * (p.high - p.low)
        ]


def settings_of(order: Sequence[tuple[str, Parameter]], values: Iterable[float]) -> Settings:
    settings: dict[str, dict[str, float]] = {}
    for (effect, parameter), value in zip(order, values, strict=True):
        settings.setdefault(effect, {})[parameter.name] = float(value)
    return settings


def fit(residuals: Residuals, candidates: Sequence[Candidate], starts: Sequence[Settings]) -> Fit:
    """The best fit of `candidates` from any of `starts`, each parameter within its range."""
    order = tuple((c.name, p) for c in candidates for p in c.parameters)
    if not order:
        residual = residuals.at({})
        empty = np.zeros((len(residual), 0))
        values = np.zeros(0)
        return Fit((), (), values, residual, empty, residuals.known, residuals.count)
    problem = _Problem(residuals, order)
    vectors = [problem.vector(start) for start in starts]
    rough = [i for i, (name, _) in enumerate(order) if not _named(candidates, name).smooth]
    found = min((problem.solve(vector, rough) for vector in vectors), key=lambda f: f[0])
    _, values, residual, jacobian = found
    return Fit(
        tuple(candidates), order, values, residual, jacobian, residuals.known, residuals.count
    )


def _named(candidates: Sequence[Candidate], name: str) -> Candidate:
    return next(candidate for candidate in candidates if candidate.name == name)


class _Problem:
    """Least squares in parameters scaled to their ranges."""

    def __init__(self, residuals: Residuals, order: Sequence[tuple[str, Parameter]]) -> None:
        self._residuals = residuals
        self._order = order
        self._low = np.array([p.low for _, p in order])
        self._span = np.array([p.high - p.low for _, p in order])

    def vector(self, settings: Settings) -> Floats:
        """A start within the open range, in units of it."""
        values = [settings[effect][p.name] for effect, p in self._order]
        scaled: Floats = np.clip((np.array(values) - self._low) / self._span, 1e-6, 1 - 1e-6)
        return scaled

    def solve(self, start: Floats, rough: list[int]) -> tuple[float, Floats, Floats, Floats]:
        """Cost, values, residual and jacobian; parameters in `rough` are scanned first."""
        for index in rough:
            start = self._scanned(start, index)
        result = optimize.least_squares(
            self._residual, start, jac=self._jacobian, bounds=(0.0, 1.0), xtol=1e-10, ftol=1e-10,
            max_nfev=40,
        )  # fmt: skip
        values = self._low + result.x * self._span
        return float(result.cost), values, result.fun, result.jac / self._span

    def _residual(self, scaled: Floats) -> Floats:
        return self._residuals.at(settings_of(self._order, self._low + scaled * self._span))

    def _jacobian(self, scaled: Floats) -> Floats:
        here = self._residual(scaled)
        columns = np.empty((len(here), len(scaled)))
        for i, value in enumerate(scaled):
            step = -_DIFFERENCE if value > 0.5 else _DIFFERENCE
            moved = scaled.copy()
            moved[i] += step
            columns[:, i] = (self._residual(moved) - here) / step
        return columns

    def _scanned(self, start: Floats, index: int) -> Floats:
        trials = np.repeat(start[None, :], _SCANNED, axis=0)
        trials[:, index] = np.linspace(0.002, 0.998, _SCANNED)
        costs = [float(r @ r) for r in map(self._residual, trials)]
        best: Floats = trials[int(np.argmin(costs))]
        return best


def probes(candidate: Candidate) -> list[Settings]:
    """Settings to try a candidate at: every combination of its parameters' starts."""
    names = [p.name for p in candidate.parameters]
    choices = product(*(p.starts for p in candidate.parameters))
    return [{candidate.name: dict(zip(names, choice, strict=True))} for choice in choices]
