"""Evidence for a set of effects: its extended BIC, and the errors of its parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from mopro.engine.assumed import (
    CLEAR,
    LEAST_SAMPLES,
    MOST_CONDITION,
    PHASE_PENALTY,
    SAME,
    STRONG,
    TINY,
    UNIFORM,
    VERY_STRONG,
)
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.fits.fit import Fit, Identity
from mopro.engine.residuals import Noise
from mopro.engine.series import Floats

# Degrees of freedom from which on Student's t is the normal distribution, to seven digits.
_MANY = 1e8


@dataclass(frozen=True)
class Evidence:
    """Judges fits by one noise, out of a `catalogue` (the keys of the candidates).

    What was asked about a fit is kept: noise with a memory takes a cosine transform of its
    residual, and of its Jacobian.
    """

    noise: Noise
    catalogue: Sequence[tuple[str, str]]
    _spreads: dict[Identity, tuple[Floats, Floats]] = field(default_factory=dict)
    _ebics: dict[Identity, float] = field(default_factory=dict)

    def ebic(self, fit: Fit) -> float:
        """Extended Bayesian information criterion (Chen and Chen 2008); lower is better.

        -2 ln L + the penalty of each parameter + 2 ln of the number of ways to choose so many
        effects out of the catalogue, plus a penalty for implausible values. Infinite where the
        noise is unknown and the samples are too few to estimate it.
        """
        if fit.identity not in self._ebics:
            self._ebics[fit.identity] = self._ebic(fit)
        return self._ebics[fit.identity]

    def _ebic(self, fit: Fit) -> float:
        if not all(self.noise.stated) and len(fit.order) >= fit.count - 1:
            return math.inf
        return self.noise.deviance(fit.residual) + self.penalty(fit)

    def penalty(self, fit: Fit) -> float:
        """EBIC of `fit` less its deviance."""
        own = sum(self.of_parameter(p, fit.count) for c in fit.candidates for p in c.parameters)
        laws = sum(STRONG for c in fit.candidates if c.law)
        choice = self.of_choice(self.findings(fit))
        return own + laws + choice + self._constants(fit) + self._implausibility(fit)

    def added_penalty(self, base: Fit, joined: Sequence[Candidate]) -> float:
        """Fall of the deviance that candidates must bring beside `base` for EBIC to fall."""
        return self.of_joining(joined, base.count, self.findings(base))

    def of_joining(self, joined: Sequence[Candidate], count: int, findings: int) -> float:
        """`added_penalty` beside a fit with `count` samples and so many findings."""
        own = sum(self.of_parameter(p, count) for c in joined for p in c.parameters)
        laws = sum(STRONG for c in joined if c.law)
        together = findings + sum(not c.calibrates for c in joined)
        return own + laws + self.of_choice(together) - self.of_choice(findings)

    def of_parameter(self, parameter: Parameter, count: int) -> float:
        """Penalty of one more parameter with `count` samples.

        Where the noise has a memory, a size is measured by so many independent samples; a
        frequency or a moment is chosen among as many as there are samples.
        """
        if parameter.role is Role.CONSTANT:
            return 0.0
        if parameter.role is Role.PHASE or parameter.cyclic:
            return PHASE_PENALTY
        if not self.noise.exact and parameter.role is Role.AMPLITUDE:
            return math.log(max(float(self.noise.samples.sum()), LEAST_SAMPLES))
        return math.log(max(count, LEAST_SAMPLES))

    def of_choice(self, chosen: int) -> float:
        """Penalty of having chosen so many effects: 2 ln(catalogue over chosen).

        Of more than half of a small catalogue that of the half: another effect earns nothing.
        """
        many = max(len(self.catalogue), chosen)
        return 2 * math.log(math.comb(many, min(chosen, many // 2)))

    def lowest(self, fits: Sequence[Fit]) -> Fit:
        """The fit of the lowest EBIC; of equal ones the simplest, the first in the catalogue.

        Neither the noise nor where a fit ends decides between effects with the same response.
        """
        least = min(map(self.ebic, fits))
        equal = (fit for fit in fits if self.ebic(fit) <= least + SAME)
        return min(equal, key=lambda fit: (fit.chosen, self.place(fit)))

    def above(self, fit: Fit, best: Fit) -> float:
        """EBIC of `fit` less that of `best`, whose remainder is the noise.

        Noise of an estimated spectrum favours the set that it is estimated from: what others leave
        more in a band counts, and nothing what they leave less. A set of no more parameters is
        credited with what `best` leaves more by the noise that this set leaves.
        """
        difference = self.ebic(fit) - self.ebic(best)
        if self.noise.exact or difference <= 0 or fit.chosen > best.chosen:
            return difference
        return max(difference - self.noise.like(fit.residual).deviance(best.residual), 0.0)

    def place(self, fit: Fit) -> list[int]:
        """The places of its effects in the catalogue, free-form terms last."""
        places = {key: i for i, key in enumerate(self.catalogue)}
        return sorted(places.get(key, len(places)) for key in fit.key)

    # -- findings and calibrations ------------------------------------------------------

    def findings(self, fit: Fit) -> int:
        """Number of its effects that are findings, and no calibrations."""
        return sum(not self.calibrated(fit, candidate) for candidate in fit.candidates)

    def calibrated(self, fit: Fit, candidate: Candidate) -> bool:
        """True if this effect corrects a number of the model within its tolerance only."""
        if not candidate.calibrates:
            return False
        own = [(p, v, d) for (name, p), v, d in self._known(fit) if name == candidate.name]
        return all(p.tolerates(value, CLEAR * d) for p, value, d in own)

    # -- plausibility -------------------------------------------------------------------

    def implausible(self, fit: Fit) -> set[str]:
        """Parameters (`effect.parameter`) at an end of their range, or clearly implausible.

        That is very strong evidence against the plausible range: at two standard deviations
        beyond it, one true value in twenty would be ruled out.
        """
        return {
            *self.at_bound(fit),
            *(
                f"{effect}.{p.name}"
                for (effect, p), value, error in self._known(fit)
                if (p.beyond(value) / error) ** 2 >= VERY_STRONG
            ),
        }

    def at_bound(self, fit: Fit) -> list[str]:
        """Parameters (`effect.parameter`) that the data would push out of their range."""
        return [f"{effect}.{p.name}" for effect, p in self._stopped(fit)]

    def _stopped(self, fit: Fit) -> list[tuple[str, Parameter]]:
        """Effect and parameter of those that an end of their range stops.

        They are within a step of finite differences of it, and by less than their standard
        deviation.
        """
        near = []
        for i, ((_, p), value) in enumerate(zip(fit.order, fit.values.tolist(), strict=True)):
            nearest = min((p.low, p.high), key=lambda bound: abs(p.scaled(value) - p.scaled(bound)))
            bounded = p.role not in (Role.PHASE, Role.CONSTANT)
            if bounded and abs(p.scaled(value) - p.scaled(nearest)) < p.difference:
                near.append((i, abs(value - nearest)))
        # Errors take a covariance, which most fits need for nothing.
        errors = self.deviations(fit) if near else ()
        return [fit.order[i] for i, distance in near if distance < errors[i]]

    def _implausibility(self, fit: Fit) -> float:
        """Rise of chi-squared if every value were moved into its plausible range, to first order.

        It grows continuously up to its limit, so that no fit gains by passing a threshold. Infinite
        where a flexible effect has the shape at which its range ends: a period that is as long as
        the data can tell is a bend, and no period.
        """
        stopped = self._stopped(fit)
        flexible = {c.name for c in fit.candidates if c.flexible}
        if any(effect in flexible and p.role is Role.SHAPE for effect, p in stopped):
            return math.inf
        beyond = np.array([
            p.beyond(v) for (_, p), v in zip(fit.order, fit.values.tolist(), strict=True)
        ])  # fmt: skip
        distances = beyond / self.deviations(fit) if beyond.any() else beyond
        rises = np.minimum(distances**2, VERY_STRONG)
        rises[[fit.order.index(parameter) for parameter in stopped]] = VERY_STRONG
        return float(rises.sum())

    def _constants(self, fit: Fit) -> float:
        """Laplace's penalty of what the data tell about assumed constants.

        2 ln(prior / posterior standard deviation) each, which is 0 where they tell nothing, as
        where parameters are not identifiable.
        """
        if not any(p.role is Role.CONSTANT for _, p in fit.order):
            return 0.0
        return sum(
            max(2 * math.log(math.sqrt(UNIFORM) * p.expected / d), 0.0)
            for (_, p), _, d in self._known(fit)
            if p.role is Role.CONSTANT and math.isfinite(d)
        )

    def _known(self, fit: Fit) -> list[tuple[tuple[str, Parameter], float, float]]:
        """Effect and parameter, value and standard deviation of all that was fitted."""
        deviations = self.deviations(fit).tolist()
        return list(zip(fit.order, fit.values.tolist(), deviations, strict=True))

    # -- errors -------------------------------------------------------------------------

    def deviations(self, fit: Fit) -> Floats:
        """Standard deviations of the parameters, in `order`; infinite if not identifiable."""
        return np.asarray(np.sqrt(np.diag(self.covariance(fit))))

    def intervals(self, fit: Fit, level: float = 0.95) -> list[tuple[float, float]]:
        """Confidence intervals of the parameters; Student's t where the noise is estimated.

        A parameter, but for an angle, lies within its range; what the data do not bound at all is
        left without ends, but for an assumed constant.
        """
        upper, freedom = (1 + level) / 2, self._spread(fit)[1]
        # Older releases of SciPy know no infinite freedom.
        student = special.stdtrit(np.minimum(freedom, _MANY), upper)
        reach = np.where(freedom < _MANY, student, special.ndtri(upper))
        half = reach * self.deviations(fit)
        return [
            _interval(p, v, h)
            for (_, p), v, h in zip(fit.order, fit.values.tolist(), half.tolist(), strict=True)
        ]

    def covariance(self, fit: Fit) -> Floats:
        """Covariance of the parameters (parameters x parameters), in `order`.

        H⁻¹ V H⁻¹, where H is the normal matrix and V the covariance of Jᵀ noise: H itself for
        white noise of variance 1, and that of noise with the residual's spectrum else. What is
        known of assumed constants beforehand counts. Infinite in the rows and columns of
        parameters that are not identifiable: what depends on none of them stays known.
        """
        return self._spread(fit)[0]

    def _spread(self, fit: Fit) -> tuple[Floats, Floats]:
        """Covariance of the parameters, and degrees of freedom of each one's variance."""
        if fit.identity not in self._spreads:
            self._spreads[fit.identity] = self._covariance(fit)
        return self._spreads[fit.identity]

    def _covariance(self, fit: Fit) -> tuple[Floats, Floats]:
        spans = np.array([p.high - p.low for _, p in fit.order])
        scaled = fit.jacobian * spans
        prior = np.diag([
            ((p.high - p.low) / p.expected) ** 2 / UNIFORM if p.role is Role.CONSTANT else 0.0
            for _, p in fit.order
        ])  # fmt: skip
        normal = scaled.T @ scaled + prior if len(spans) else prior
        if not np.isfinite(normal).all():
            return np.full_like(normal, math.inf), np.full(len(spans), math.inf)
        lengths = np.sqrt(np.diag(normal))
        lengths[lengths == 0] = 1.0
        units = np.outer(lengths, lengths)
        weights, directions = np.linalg.eigh(normal / units)
        seen = weights > weights.max(initial=0.0) / MOST_CONDITION
        inverse = (directions[:, seen] / weights[seen]) @ directions[:, seen].T
        # Along a direction that the data do not tell, rounding is the only weight.
        along = np.sum(directions[:, ~seen] ** 2, axis=1)
        unknown = along > np.finfo(float).eps * np.diag(inverse)
        inverse /= units
        noise, freedom = self._of_noise(fit, scaled, inverse)
        variance = noise + inverse @ prior @ inverse
        variance[unknown, :] = variance[:, unknown] = math.inf
        return np.asarray(variance * np.outer(spans, spans)), freedom

    def _of_noise(self, fit: Fit, scaled: Floats, inverse: Floats) -> tuple[Floats, Floats]:
        """Covariance that the noise gives the parameters, and its degrees of freedom.

        H⁻¹ (Σ ĵ ĵᵀ S) H⁻¹ over the frequencies, S being the noise's spectrum.
        """
        if not self.noise.exact:
            return self.noise.like(fit.residual).spread(scaled, inverse)
        freedom = max(fit.count - len(fit.order), 1)
        known = all(self.noise.stated)
        size = 1.0 if known else max(fit.rss / freedom, TINY)
        covariance = size * (inverse @ (scaled.T @ scaled) @ inverse)
        return covariance, np.full(len(inverse), math.inf if known else freedom)


def _interval(parameter: Parameter, value: float, half: float) -> tuple[float, float]:
    """`value` ± `half`, within the range of the parameter."""
    assumed = parameter.role is Role.CONSTANT
    if parameter.role is Role.PHASE or not (assumed or math.isfinite(half)):
        return value - half, value + half
    return max(value - half, parameter.low), min(value + half, parameter.high)
