"""Values of what was fitted, with intervals that count in what was not, and correlations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mopro.engine.candidate import Candidate, Role
from mopro.engine.fits import Evidence, Fit, HeldOut, with_central_jacobian, with_tolerances
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.series import Settings
from mopro.engine.state import State
from mopro.engine.verdict import Estimate

# A parameter by the names of its effect and its own.
_Place = tuple[str, str]
_Interval = tuple[float, float]


@dataclass(frozen=True)
class Sizes:
    """Values, intervals, correlations and support of the effects `named`, by a `fit`.

    Beside drafts by the fit with the free-form terms: without, an effect makes up for a part of
    what the terms describe, or is hidden by it.
    """

    named: Fit
    fit: Fit
    evidence: Evidence
    held: HeldOut | None
    hypotheses: Hypotheses

    @staticmethod
    def of(state: State) -> Sizes:
        if state.drafted is not None and state.fit.key <= state.drafted.key:
            return Sizes.by(state, state.drafted, state.drafted_held)
        return Sizes.by(state, state.fit, state.held)

    @staticmethod
    def by(state: State, fit: Fit, held: HeldOut | None) -> Sizes:
        """The sizes by a `fit` that `held` tells of."""
        hypotheses, evidence = state.hypotheses, state.hypotheses.evidence
        if fit is not state.fit:
            evidence = hypotheses.evidence_by(fit)
        own = Evidence(evidence.noise, evidence.catalogue)
        return Sizes(
            state.fit, with_central_jacobian(hypotheses.residuals, fit), own, held, hypotheses
        )

    @property
    def settings(self) -> Settings:
        """The settings of the effects, and of the model's free numbers."""
        return self.fit.settings_without(self.fit.names - self.named.names)

    def estimates(self, candidate: Candidate) -> dict[str, Estimate]:
        """The parameters of an effect, by name."""
        values, bounds = self.fit.settings[candidate.name], self.evidence.at_bound(self.fit)
        estimates = {}
        for p in candidate.parameters:
            # A value that a search found has no interval.
            interval = self._intervals.get((candidate.name, p.name), (math.nan, math.nan))
            at_bound = f"{candidate.name}.{p.name}" in bounds
            estimates[p.name] = Estimate(float(values[p.name]), p.unit, interval, at_bound)
        return estimates

    @cached_property
    def _intervals(self) -> dict[_Place, _Interval]:
        """95 % intervals of all that was fitted."""
        return _intervals(self.hypotheses, self.fit, self.evidence)

    def correlations(self) -> dict[str, dict[str, float]]:
        """Correlations of the estimates, without those that are not identifiable."""
        covariance = self.evidence.covariance(self.fit)
        named = np.array([effect in self.settings for effect, _ in self.fit.order], dtype=bool)
        own = np.flatnonzero(named & (np.diag(covariance) > 0) & np.isfinite(np.diag(covariance)))
        deviations = np.sqrt(np.diag(covariance)[own])
        correlation = covariance[np.ix_(own, own)] / np.outer(deviations, deviations)
        names = [f"{effect}.{p.name}" for effect, p in (self.fit.order[i] for i in own)]
        return {
            one: dict(zip(names, row, strict=True))
            for one, row in zip(names, correlation.round(4).tolist(), strict=True)
        }


def _intervals(hypotheses: Hypotheses, fit: Fit, evidence: Evidence) -> dict[_Place, _Interval]:
    """95 % intervals of a fit, which hold its values.

    They count in the tolerances of numbers that it does not fit. A shape at an end of its range
    may be beyond it: there the interval has no end.
    """
    wide = with_tolerances(hypotheses.residuals, fit, hypotheses.catalogue)
    # Evidence keeps what it knows of a fit by its sum of squares, which both have.
    ends = Evidence(evidence.noise, evidence.catalogue).intervals(wide)
    bounds = evidence.at_bound(fit)
    found = {}
    for (effect, p), (low, high) in zip(wide.order, ends, strict=True):
        if effect in fit.settings:
            value = fit.settings[effect][p.name]
            if p.role is Role.SHAPE and f"{effect}.{p.name}" in bounds:
                low, high = _open(value, p.low, p.high, low, high)
            found[effect, p.name] = min(low, value), max(high, value)
    return found


def _open(value: float, least: float, most: float, low: float, high: float) -> _Interval:
    """The interval from `low` to `high` without its end at that end of the range that is near."""
    return (-math.inf, high) if value - least < most - value else (low, math.inf)
