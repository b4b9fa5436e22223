"""Least-squares fit of a set of effects, its errors and its evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from mopro.diagnosis.descent import Descent
from mopro.diagnosis.jacobian import gauss_newton_step
from mopro.diagnosis.model import Candidate, Floats, Parameter, Role, Settings
from mopro.diagnosis.residual import Residuals

# Distance from an end of the range, as a share of it, within which a value may be stopped there.
_NEAR_BOUND = 1e-3
# Chi-squared by which a fit may be above its minimum. Doubled, it saves a simulation now and then;
# evidence is compared in steps of 1 at the least.
CHI2_TOLERANCE = 0.01
# Greatest penalty (chi-squared) of one implausible value, and that of one stopped by its range: a
# Bayes factor of 150, "very strong" (Kass and Raftery 1995).
_MOST_IMPLAUSIBLE = 10.0
# Standard deviations by which a value must be outside a range to be clearly so (95 %).
_CLEARLY_OUTSIDE = 2.0
# Penalty (chi-squared) of an angle that may be anything: its prior is bounded, and a line that is
# seen at all determines it to about 0.2 rad. 2 ln(2π / (0.2 √(2π))) = 5.
_PHASE_PENALTY = 5.0
# Least number of samples that a parameter's penalty, ln n, is taken for: a handful of precise
# samples determines a parameter to a tenth of its prior, which the logarithm of their number
# does not tell. Doubled, each parameter of a small table must gain 0.7 more.
_LEAST_SAMPLES = 100
# Largest argument of exp() that gives a number.
_MOST_EXPONENT = 700.0
# Smallest sum of squares, in place of 0, where a logarithm or a quotient is taken.
_TINY = 1e-300
# Condition number of the normal matrix beyond which parameters are not identifiable.
_MOST_CONDITION = 1e12
# Step of the derivative of a parameter by its scaled coordinate.
_SCALE_STEP = 1e-6


@dataclass(frozen=True)
class Fit:
    """Effects fitted together.

    `order`: effect and parameter of each column of `jacobian`. `residual`: whitened, nuisances
    projected out (samples). `jacobian`: its derivative (samples x parameters, per unit of each).
    `count`: samples less nuisances. `searched`: number of parameters that a search found and
    least squares did not fit. `abandoned`: the fit was given up before its minimum, as it could
    not come near the limit asked for.
    """

    candidates: tuple[Candidate, ...]
    order: tuple[tuple[str, Parameter], ...]
    settings: Settings
    residual: Floats
    jacobian: Floats
    known_noise: bool
    count: int
    searched: int = 0
    abandoned: bool = False

    @property
    def names(self) -> frozenset[str]:
        return frozenset(candidate.name for candidate in self.candidates)

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        """The set of effects, each in its form."""
        return frozenset(candidate.key for candidate in self.candidates)

    @property
    def identity(self) -> tuple[frozenset[tuple[str, str]], float]:
        """Cache key: the set of effects and its sum of squares."""
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
        """Sum of squares beyond what noise leaves."""
        return self.rss - self.count * self.noise_variance

    @property
    def noise_variance(self) -> float:
        """Variance of the noise in the whitened residual: 1, or its estimate where unknown."""
        freedom = max(self.count - len(self.order), 1)
        return 1.0 if self.known_noise else max(self.rss / freedom, _TINY)

    # -- evidence --------------------------------------------------------------------

    @property
    def deviance(self) -> float:
        """-2 ln likelihood, up to a constant."""
        return self.deviance_of(self.rss)

    def deviance_of(self, rss: float) -> float:
        """The deviance at a sum of squares of `rss`: rss, or n ln(rss/n) with unknown noise."""
        if self.known_noise:
            return rss
        n = max(self.count, 1)
        return n * math.log(max(rss, _TINY) / n)

    def rss_of(self, deviance: float) -> float:
        """Inverse of `deviance_of`."""
        if self.known_noise:
            return deviance
        n = max(self.count, 1)
        return n * math.exp(min(deviance / n, _MOST_EXPONENT))

    def ebic(self, catalogue_size: int) -> float:
        """Extended Bayesian information criterion (Chen and Chen 2008); lower is better.

        -2 ln L + Σ penalty of each parameter + 2 ln of the number of ways to choose so many
        effects out of the catalogue, plus a penalty for implausible values. Infinite where the
        noise is unknown and the samples are too few to estimate it.
        """
        if not self.known_noise and len(self.order) >= self.count - 1:
            return math.inf
        choice = choice_penalty(self.findings, catalogue_size)
        return self.deviance + self.penalty + choice + self._implausibility

    @property
    def penalty(self) -> float:
        """Penalty of all parameters: ln n each, n being the samples less nuisances."""
        fitted = sum(parameter_penalty(parameter, self.count) for _, parameter in self.order)
        return fitted + self.searched * math.log(max(self.count, _LEAST_SAMPLES))

    @property
    def findings(self) -> int:
        """Number of its effects that are findings, and no calibrations."""
        return sum(not self.calibrated(candidate) for candidate in self.candidates)

    def calibrated(self, candidate: Candidate) -> bool:
        """True if this effect corrects a number of the model within its tolerance only."""
        return candidate.calibrates and candidate.name not in self._beyond_tolerance

    @cached_property
    def _beyond_tolerance(self) -> frozenset[str]:
        """The effects with a value that is in no tolerance, its error allowed for."""
        known = zip(self.order, self.values.tolist(), self.deviations().tolist(), strict=True)
        return frozenset(
            name for (name, p), value, d in known if not p.tolerates(value, _CLEARLY_OUTSIDE * d)
        )

    @cached_property
    def _implausibility(self) -> float:
        """Rise of chi-squared if every value were moved into its plausible range, to first order.

        It grows continuously up to its limit, so that no fit gains by passing a threshold.
        """
        most = math.sqrt(_MOST_IMPLAUSIBLE)
        at_bound = _MOST_IMPLAUSIBLE * len(self.at_bound())
        return at_bound + sum(min(distance, most) ** 2 for distance in self._implausible_by())

    def _implausible_by(self) -> list[float]:
        """Distance of each value from its plausible range, in standard deviations."""
        known = zip(self.order, self.values.tolist(), self.deviations().tolist(), strict=True)
        return [p.beyond(value) / deviation for (_, p), value, deviation in known]

    @property
    def plausible(self) -> bool:
        """True if every parameter is within its plausible range, its error allowed for."""
        furthest = max(self._implausible_by(), default=0.0)
        return not self.at_bound() and furthest <= _CLEARLY_OUTSIDE

    # -- errors ------------------------------------------------------------------------

    def deviations(self) -> Floats:
        """Standard deviations of the parameters, in `order`; infinite if not identifiable."""
        spans = np.array([p.high - p.low for _, p in self.order])
        scaled = self.jacobian * spans
        strengths = np.linalg.norm(scaled, axis=0)
        if not len(spans) or not strengths.all() or not np.isfinite(strengths).all():
            return np.full(len(spans), math.inf)
        units = scaled / strengths
        gram = units.T @ units
        if np.linalg.cond(gram) > _MOST_CONDITION:
            return np.full(len(spans), math.inf)
        own = np.sqrt(np.maximum(np.diag(np.linalg.inv(gram)), 0) * self.noise_variance)
        deviations: Floats = own / strengths * spans
        return deviations

    def intervals(self, level: float = 0.95) -> list[tuple[float, float]]:
        """Confidence intervals of the parameters, in `order`; Student's t with unknown noise."""
        freedom = max(self.count - len(self.order), 1)
        spread = stats.norm if self.known_noise else stats.t(freedom)
        half = spread.ppf((1 + level) / 2) * self.deviations()
        return [(v - h, v + h) for v, h in zip(self.values.tolist(), half.tolist(), strict=True)]

    def at_bound(self) -> list[str]:
        """Parameters (`effect.parameter`) that the data would push out of their range.

        Those within 1/1000 of an end of it, and by less than their standard deviation.
        """
        names = []
        errors = self.deviations().tolist()
        for (effect, p), value, error in zip(self.order, self.values.tolist(), errors, strict=True):
            nearest = min((p.low, p.high), key=lambda bound: abs(p.scaled(value) - p.scaled(bound)))
            near = abs(p.scaled(value) - p.scaled(nearest)) < _NEAR_BOUND
            if p.role is not Role.PHASE and near and abs(value - nearest) < error:
                names.append(f"{effect}.{p.name}")
        return names

    def others_without(self, name: str) -> Settings:
        """Settings of the other effects if `name` were off: one Gauss-Newton step."""
        own = np.array([effect == name for effect, _ in self.order], dtype=bool)
        off = [
            p.null - value if effect == name and p.role is Role.AMPLITUDE else 0.0
            for (effect, p), value in zip(self.order, self.values.tolist(), strict=True)
        ]
        moved = {effect: dict(values) for effect, values in self.settings.items() if effect != name}
        change = self.jacobian @ np.nan_to_num(off, posinf=0.0, neginf=0.0)
        steps = gauss_newton_step(self.jacobian[:, ~own], change).tolist()
        others = (entry for entry, mine in zip(self.order, own, strict=True) if not mine)
        for (effect, p), step in zip(others, steps, strict=True):
            moved[effect][p.name] = p.within(moved[effect][p.name] + step)
        return moved


def parameter_penalty(parameter: Parameter, count: int) -> float:
    """Fall of chi-squared that one more parameter must bring, with `count` samples."""
    if parameter.role is Role.PHASE:
        return _PHASE_PENALTY
    return math.log(max(count, _LEAST_SAMPLES))


def choice_penalty(chosen: int, catalogue_size: int) -> float:
    """Penalty of having chosen so many effects: 2 ln(catalogue_size over chosen)."""
    return 2 * math.log(math.comb(max(catalogue_size, chosen), chosen))


def least_squares_fit(
    residuals: Residuals,
    candidates: Sequence[Candidate],
    starts: Sequence[Settings],
    rss_limit: float = math.inf,
) -> Fit:
    """The best fit of `candidates` from any of `starts`, each parameter within its range.

    A start has a value for every parameter; those that are searched keep it. A fit that
    cannot come down to a sum of squares of `rss_limit` is `abandoned`.
    """
    problems = [_Problem(residuals, candidates, start) for start in starts]
    return min((problem.solve(rss_limit) for problem in problems), key=lambda fit: fit.rss)


class _Problem:
    """Least squares from one start, in parameters scaled to their ranges."""

    def __init__(
        self, residuals: Residuals, candidates: Sequence[Candidate], start: Settings
    ) -> None:
        self._residuals = residuals
        self._candidates = tuple(candidates)
        all_of_them = [(c.name, p) for c in candidates for p in c.parameters]
        self._order = tuple((n, p) for n, p in all_of_them if p.role is not Role.SEARCHED)
        self._searched = len(all_of_them) - len(self._order)
        self._start = start
        self._last: tuple[tuple[float, ...], Floats] | None = None

    def solve(self, rss_limit: float) -> Fit:
        scaled = np.array([p.scaled(self._start[name][p.name]) for name, p in self._order])
        low, high = self._box()
        if not self._order:
            residual = self._residual(scaled)
            return self._fit(scaled, residual, np.zeros((len(residual), 0)))
        descent = Descent(self._residual, [p.difference for _, p in self._order], rss_limit)
        tolerance = CHI2_TOLERANCE / max(self._residuals.count, 1)
        reached = descent.run(scaled, low, high, tolerance)
        fit = self._fit(reached.x, reached.residual, reached.jacobian)
        return replace(fit, abandoned=descent.abandoned)

    def _box(self) -> tuple[Floats, Floats]:
        """Lower and upper ends of the scaled parameters; an angle may go once around either way."""
        turns = np.array([1.0 if p.role is Role.PHASE else 0.0 for _, p in self._order])
        return -turns, 1 + turns

    def _fit(self, scaled: Floats, residual: Floats, jacobian: Floats) -> Fit:
        coordinates = list(zip((p for _, p in self._order), scaled.tolist(), strict=True))
        h = _SCALE_STEP
        spans = np.array([(p.value(s + h) - p.value(s - h)) / (2 * h) for p, s in coordinates])
        return Fit(
            candidates=self._candidates,
            order=self._order,
            settings=self._settings([p.within(p.value(s)) for p, s in coordinates]),
            residual=residual,
            jacobian=jacobian / spans if len(spans) else jacobian,
            known_noise=self._residuals.known_noise,
            count=self._residuals.count,
            searched=self._searched,
        )

    def _settings(self, values: Sequence[float]) -> Settings:
        settings: dict[str, dict[str, float]] = {
            c.name: {**c.fixed, **_searched_values(c, self._start)} for c in self._candidates
        }
        for (effect, parameter), value in zip(self._order, values, strict=True):
            settings[effect][parameter.name] = float(value)
        return settings

    def _residual(self, scaled: Floats) -> Floats:
        """The residual; the last one is stored, as the solver asks for its Jacobian next."""
        point = tuple(scaled.tolist())
        if self._last is None or self._last[0] != point:
            values = [p.value(s) for (_, p), s in zip(self._order, point, strict=True)]
            self._last = point, self._residuals.at(self._settings(values))
        return self._last[1]


def _searched_values(candidate: Candidate, start: Settings) -> Mapping[str, float]:
    names = [p.name for p in candidate.parameters if p.role is Role.SEARCHED]
    return {name: start[candidate.name][name] for name in names}
