"""Fits of a set of effects: least squares within plausible ranges, and what they are worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from mopro.diagnosis.descent import Descent
from mopro.diagnosis.model import Candidate, Floats, Parameter, Role, Settings
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.slopes import step_against

_NEAR_BOUND = 1e-3
# What a fit may still be off its minimum, in chi-squared.
_CLOSE_ENOUGH = 0.01
# The most that an implausible value costs, as does one that its range holds back: odds of
# 150 to 1.
_IMPLAUSIBLE = 10.0
_CLEARLY = 2.0
# What an angle costs that may be anything: its prior is bounded, and a line that is seen
# at all fixes it within about a fifth of a radian (2 ln of 2π over that, times √2π).
_PHASE_PRICE = 5.0
# A parameter costs no less than among so many samples, however few there are: a handful of
# precise ones fixes it to a tenth of what it might have been, and ln n forgets that.
_FEWEST = 100
# Beyond this an exponential is no number.
_MOST_EXPONENT = 700.0


@dataclass(frozen=True)
class Fit:
    """Effects fitted together; `residual` is whitened, `jacobian` its derivative.

    Rows of `jacobian` are samples, columns the parameters in `order`; `held` counts those
    that were found otherwise. One that is `hopeless` was given up on its way.
    """

    candidates: tuple[Candidate, ...]
    order: tuple[tuple[str, Parameter], ...]
    settings: Settings
    residual: Floats
    jacobian: Floats
    known_noise: bool
    count: int
    held: int = 0
    hopeless: bool = False

    @property
    def names(self) -> frozenset[str]:
        return frozenset(candidate.name for candidate in self.candidates)

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        return frozenset(candidate.key for candidate in self.candidates)

    @property
    def identity(self) -> tuple[frozenset[tuple[str, str]], float]:
        """What tells it from other fits, of the same effects as well."""
        return self.key, self.rss

    @property
    def values(self) -> Floats:
        return np.array([self.settings[effect][p.name] for effect, p in self.order])

    @cached_property
    def rss(self) -> float:
        """Sum of squares of the whitened residual: chi-squared where the noise is known."""
        return float(self.residual @ self.residual)

    @property
    def excess(self) -> float:
        """What is left over beyond noise, of the sum of squares."""
        return self.rss - self.count * self.variance

    @property
    def misfit(self) -> float:
        """-2 log likelihood but for a constant."""
        return self.misfit_of(self.rss)

    def misfit_of(self, rss: float) -> float:
        """The misfit that a sum of squares of `rss` would be."""
        if self.known_noise:
            return rss
        n = max(self.count, 1)
        return n * math.log(max(rss, 1e-300) / n)

    def rss_of(self, misfit: float) -> float:
        """The sum of squares of which the misfit is `misfit`."""
        if self.known_noise:
            return misfit
        n = max(self.count, 1)
        return n * math.exp(min(misfit / n, _MOST_EXPONENT))

    def cost(self, pool: int) -> float:
        """-2 log likelihood, and the price of each parameter and of having had `pool` choices.

        The extended Bayesian information criterion of Chen and Chen (2008): k ln n + 2 ln
        of the number of ways to choose so many effects. Where the noise is unknown, fewer
        samples than it takes to tell it are worth nothing.
        """
        if not self.known_noise and len(self.order) >= self.count - 1:
            return math.inf
        chosen = choice_price(self.chosen, pool)
        return self.misfit + self.price + chosen + self._implausible

    @property
    def chosen(self) -> int:
        """How many of its effects are findings, and no calibrations."""
        return sum(not self.calibrated(candidate) for candidate in self.candidates)

    def calibrated(self, candidate: Candidate) -> bool:
        """Whether one of its effects does no more than the model's tolerances allow for."""
        return candidate.calibrates and candidate.name not in self._intolerable

    @cached_property
    def _intolerable(self) -> frozenset[str]:
        """The effects with a value that is in no tolerance, errors allowed for."""
        known = zip(self.order, self.values.tolist(), self.deviations().tolist(), strict=True)
        return frozenset(name for (name, p), v, d in known if not p.tolerates(v, _CLEARLY * d))

    @property
    def price(self) -> float:
        """What the parameters cost."""
        own = sum(price(parameter, self.count) for _, parameter in self.order)
        return own + self.held * math.log(max(self.count, _FEWEST))

    @cached_property
    def _implausible(self) -> float:
        """What it would cost to keep every value in its plausible range, to first order.

        It grows evenly, so that nothing is worth having for moving a value past a mark.
        """
        most = math.sqrt(_IMPLAUSIBLE)
        held_back = _IMPLAUSIBLE * len(self.at_bound())
        return held_back + sum(min(far, most) ** 2 for far in self._beyond())

    def _beyond(self) -> list[float]:
        """How far each value is outside its plausible range, in standard deviations."""
        known = zip(self.order, self.values.tolist(), self.deviations().tolist(), strict=True)
        return [p.beyond(value) / deviation for (_, p), value, deviation in known]

    @property
    def plausible(self) -> bool:
        """Whether every parameter is within its plausible range, errors allowed for."""
        return not self.at_bound() and max(self._beyond(), default=0.0) <= _CLEARLY

    @property
    def variance(self) -> float:
        """Of the noise in the whitened residual: 1, or what the fit says where it is unknown."""
        freedom = max(self.count - len(self.order), 1)
        return 1.0 if self.known_noise else max(self.rss / freedom, 1e-300)

    def deviations(self) -> Floats:
        """The parameters' standard deviations, in `order`; infinite if not identifiable."""
        spans = np.array([p.high - p.low for _, p in self.order])
        scaled = self.jacobian * spans
        strengths = np.linalg.norm(scaled, axis=0)
        if not len(spans) or not strengths.all() or not np.isfinite(strengths).all():
            return np.full(len(spans), math.inf)
        units = scaled / strengths
        gram = units.T @ units
        if np.linalg.cond(gram) > 1e12:
            return np.full(len(spans), math.inf)
        own = np.sqrt(np.maximum(np.diag(np.linalg.inv(gram)), 0) * self.variance)
        deviations: Floats = own / strengths * spans
        return deviations

    def others_without(self, name: str) -> Settings:
        """Where the other effects would go if `name` were off, as far as the slopes tell."""
        own = np.array([effect == name for effect, _ in self.order], dtype=bool)
        off = [
            p.null - value if effect == name and p.role is Role.AMPLITUDE else 0.0
            for (effect, p), value in zip(self.order, self.values.tolist(), strict=True)
        ]
        kept = {effect: dict(values) for effect, values in self.settings.items() if effect != name}
        change = self.jacobian @ np.nan_to_num(off, posinf=0.0, neginf=0.0)
        steps = step_against(self.jacobian[:, ~own], change).tolist()
        others = (entry for entry, mine in zip(self.order, own, strict=True) if not mine)
        for (effect, p), step in zip(others, steps, strict=True):
            kept[effect][p.name] = p.within(kept[effect][p.name] + step)
        return kept

    def intervals(self, level: float = 0.95) -> list[tuple[float, float]]:
        """Confidence intervals of the parameters, in `order`."""
        freedom = max(self.count - len(self.order), 1)
        spread = stats.norm if self.known_noise else stats.t(freedom)
        half = spread.ppf((1 + level) / 2) * self.deviations()
        return [(v - h, v + h) for v, h in zip(self.values.tolist(), half.tolist(), strict=True)]

    def at_bound(self) -> list[str]:
        """The parameters that the data would push out of their range.

        Near a bound, and not clear of it by what they are known to.
        """
        names = []
        known = self.deviations().tolist()
        for (effect, p), value, error in zip(self.order, self.values.tolist(), known, strict=True):
            nearest = min((p.low, p.high), key=lambda bound: abs(p.scaled(value) - p.scaled(bound)))
            near = abs(p.scaled(value) - p.scaled(nearest)) < _NEAR_BOUND
            if p.role is not Role.PHASE and near and abs(value - nearest) < error:
                names.append(f"{effect}.{p.name}")
        return names


def price(parameter: Parameter, count: int) -> float:
    """What a parameter must gain in chi-squared to be worth having, with `count` samples."""
    return _PHASE_PRICE if parameter.role is Role.PHASE else math.log(max(count, _FEWEST))


def choice_price(count: int, pool: int) -> float:
    """What it costs to have chosen `count` out of `pool`; calibrations are not chosen."""
    return 2 * math.log(math.comb(max(pool, count), count))


def fit(
    residuals: Residuals,
    candidates: Sequence[Candidate],
    starts: Sequence[Settings],
    limit: float = math.inf,
) -> Fit:
    """The best fit of `candidates` from any of `starts`, each parameter within its range.

    A start has a value for every parameter; those that are held keep it. A fit that does
    not come near a sum of squares of `limit` is given up, as `hopeless`.
    """
    problems = [_Problem(residuals, candidates, start) for start in starts]
    return min((problem.solve(limit) for problem in problems), key=lambda found: found.rss)


class _Problem:
    """Least squares from one start, in parameters scaled to their ranges."""

    def __init__(
        self, residuals: Residuals, candidates: Sequence[Candidate], start: Settings
    ) -> None:
        self._residuals = residuals
        self._candidates = tuple(candidates)
        all_of_them = [(c.name, p) for c in candidates for p in c.parameters]
        self._order = tuple((n, p) for n, p in all_of_them if p.role is not Role.HELD)
        self._held = len(all_of_them) - len(self._order)
        self._start = start
        self._last: tuple[tuple[float, ...], Floats] | None = None

    def solve(self, limit: float) -> Fit:
        scaled = np.array([p.scaled(self._start[name][p.name]) for name, p in self._order])
        low, high = self._limits()
        if not self._order:
            return self._fit(scaled, self._residual(scaled), np.zeros((0, 0)))
        descent = Descent(self._residual, [p.difference for _, p in self._order], limit)
        tolerance = _CLOSE_ENOUGH / max(self._residuals.count, 1)
        place = descent.run(scaled, low, high, tolerance)
        found = self._fit(place.x, place.residual, place.slopes)
        return replace(found, hopeless=descent.hopeless)

    def _limits(self) -> tuple[Floats, Floats]:
        """An angle may go once around either way."""
        turns = np.array([1.0 if p.role is Role.PHASE else 0.0 for _, p in self._order])
        return -turns, 1 + turns

    def _fit(self, scaled: Floats, residual: Floats, jacobian: Floats) -> Fit:
        if not self._order:
            jacobian = np.zeros((len(residual), 0))
        places = list(zip((p for _, p in self._order), scaled.tolist(), strict=True))
        slopes = np.array([(p.value(s + 1e-6) - p.value(s - 1e-6)) / 2e-6 for p, s in places])
        return Fit(
            candidates=self._candidates,
            order=self._order,
            settings=self._settings([p.within(p.value(s)) for p, s in places]),
            residual=residual,
            jacobian=jacobian / slopes if len(slopes) else jacobian,
            known_noise=self._residuals.known,
            count=self._residuals.count,
            held=self._held,
        )

    def _settings(self, values: Sequence[float]) -> Settings:
        settings: dict[str, dict[str, float]] = {
            c.name: {**c.fixed, **_held(c, self._start)} for c in self._candidates
        }
        for (effect, parameter), value in zip(self._order, values, strict=True):
            settings[effect][parameter.name] = float(value)
        return settings

    def _residual(self, scaled: Floats) -> Floats:
        """The residual; the last one is kept, as the solver asks for its slope next."""
        asked = tuple(scaled.tolist())
        if self._last is None or self._last[0] != asked:
            values = [p.value(s) for (_, p), s in zip(self._order, asked, strict=True)]
            self._last = asked, self._residuals.at(self._settings(values))
        return self._last[1]


def _held(candidate: Candidate, start: Settings) -> Mapping[str, float]:
    names = [p.name for p in candidate.parameters if p.role is Role.HELD]
    return {name: start[candidate.name][name] for name in names}
