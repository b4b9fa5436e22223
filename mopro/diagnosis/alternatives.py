"""Alternatives to an effect of a fit: effects that do as well in its place."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fit_cache import FitCache, Identity
from mopro.diagnosis.model import Settings
from mopro.diagnosis.screening import ALTERNATIVE_MARGIN, LINEARITY_ERROR, Screening
from mopro.diagnosis.signature import ScoreTest
from mopro.diagnosis.ties import lowest_first

# Alternatives that are fitted in the place of one effect, one or two fits each. Fewer, and larger
# families lose members.
_MOST_FITTED = 5
# Largest error of the predicted reduction that is allowed for, as a share of it.
_MOST_LINEARITY_ERROR = 0.1
# Share of an effect's reduction by which an alternative may fall short of what is needed and still
# have its signature simulated again, where it would stand.
_WORTH_RELINEARISING = 0.2
# Chi-squared explained (20 standard deviations in all) below which an effect is so small that its
# response is linear.
_WEAK = 400.0
# Standard deviations by which a size must be outside of what is plausible to be clearly so.
_CLEARLY_IMPLAUSIBLE = 2.0
# If dropping an effect and fitting the others again leaves less than this share of the sum of
# squares that it leaves with the others unchanged, the others have absorbed the effect, and a
# search for starts must look at the residual before that.
_ABSORBED = 0.8
# EBIC above that of a fit from which on no alternative is looked at: its chi-squared is larger
# than any saving in penalties.
OUT_OF_REACH = 100.0
# Level of the chi-squared test that two nested fits predict the same: noise alone parts them more
# in one of a thousand cases.
_NESTED_LEVEL = 0.999


@dataclass(frozen=True)
class Alternative:
    """An effect that does as well as another: its EBIC above that one's, and all settings."""

    name: str
    delta_ebic: float
    settings: Settings


def _delta_ebic(alternative: Alternative) -> float:
    return alternative.delta_ebic


class Alternatives:
    """Looks for candidates that may take the place of an effect of a fit."""

    def __init__(self, fits: FitCache, screening: Screening) -> None:
        self._fits = fits
        self._screening = screening
        self._in_place: dict[tuple[Identity, str], tuple[Fit, list[ScoreTest]]] = {}

    def of(self, fit: Fit, name: str) -> list[Alternative]:
        """The effects within 10 of the EBIC of `fit` in the place of `name`, best first.

        A weak effect has many alternatives, most of them nearly linear: one that does as well
        at the size that its signature asks for is not fitted.
        """
        swaps = self.swaps(fit, name)
        alternatives = self._among(swaps, fit)
        fitted = {candidate.key for swap in swaps for candidate in swap.candidates}
        reduced, scores = self._in_place_of(fit, name)
        if reduced.rss - fit.rss < _WEAK:
            promising = [
                s
                for s in scores
                if s.candidate.name != name and s.candidate.key not in fitted and _plausible(s)
                and self._predicted_delta(reduced, s, fit) < ALTERNATIVE_MARGIN
            ]  # fmt: skip
            for weak in self._fits.each(lambda s: self._weak(fit, name, s), promising):
                if weak:
                    alternatives.setdefault(weak.name, weak)
        names = [candidate.name for candidate in self._fits.catalogue]
        return lowest_first(
            alternatives.values(), _delta_ebic, lambda other: names.index(other.name)
        )

    def _among(self, swaps: list[Fit], fit: Fit) -> dict[str, Alternative]:
        """The best alternative of each name among fits with one effect of `fit` replaced."""
        best: dict[str, Alternative] = {}
        for swap in swaps:
            fresh = [c for c in swap.candidates if c.name not in fit.names]
            # It has been dropped again if EBIC fell by that.
            if len(fresh) != 1:
                continue
            (candidate,) = fresh
            delta = self._fits.ebic(swap) - self._fits.ebic(fit)
            as_good = delta < ALTERNATIVE_MARGIN and swap.plausible
            # A form that was extended for its fit needs its parameters.
            extended = candidate.extends and not candidate.can_enter_first
            if as_good and (extended or not _nests_prediction(swap, fit)):
                other = Alternative(candidate.name, delta, swap.settings)
                best[candidate.name] = min(other, best.get(candidate.name, other), key=_delta_ebic)
        return best

    def swaps(self, fit: Fit, name: str) -> list[Fit]:
        """Fits with the likeliest alternatives in the place of `name`."""
        reduced, scores = self._in_place_of(fit, name)
        needed, likely = self._likely(fit, name, reduced, scores)
        scores = self._fits.each(
            lambda s: (
                s if s.predicted_reduction > needed else self._screening.at_its_start(reduced, s)
            ),
            likely,
        )
        close = sorted(
            (s for s in scores if s.predicted_reduction > needed),
            key=lambda s: -s.predicted_reduction,
        )
        limit = _rss_limit(fit)
        swaps = self._fits.each(
            lambda s: self._fits.with_replaced(fit, name, s, limit), close[:_MOST_FITTED]
        )
        return [*swaps, *self._fits.each(lambda f: self._fits.with_best_forms(f, limit), swaps)]

    def _likely(
        self, fit: Fit, name: str, reduced: Fit, scores: list[ScoreTest]
    ) -> tuple[float, list[ScoreTest]]:
        """Predicted reduction needed to replace `name`, and the candidates that come near it."""
        reduction = reduced.rss - fit.rss
        # Far from linear, signatures predict less for the effect itself than it brings.
        predicted = max(
            (s.predicted_reduction for s in scores if s.candidate.name == name), default=reduction
        )
        error = min(_MOST_LINEARITY_ERROR, LINEARITY_ERROR + 2 * abs(predicted / reduction - 1))
        needed = min(reduction, predicted) - 4 * ALTERNATIVE_MARGIN - error * reduction
        if reduction < _WEAK:
            needed = min(reduction, predicted)
        least = needed - _WORTH_RELINEARISING * reduction
        likely = [
            s
            for s in scores
            if s.candidate.name != name and s.starts and s.predicted_reduction > least
        ]
        return needed, likely

    def _predicted_delta(self, reduced: Fit, score: ScoreTest, fit: Fit) -> float:
        return self._screening.predicted_ebic(reduced, score) - self._fits.ebic(fit)

    def _weak(self, fit: Fit, name: str, score: ScoreTest) -> Alternative | None:
        """The alternative at the size its signature asks for, or else fitted; None if neither."""
        reduced = self._fits.without(fit, name)
        settings: Settings = {**reduced.settings, **score.starts[0]}
        rss = float(np.sum(self._fits.residuals.at(settings) ** 2))
        simulated = replace(score, predicted_reduction=reduced.rss - rss)
        delta = self._predicted_delta(reduced, simulated, fit)
        if delta >= ALTERNATIVE_MARGIN:
            swap = self._fits.with_replaced(fit, name, score, _rss_limit(fit))
            settings = swap.settings
            delta = self._fits.ebic(swap) - self._fits.ebic(fit)
            if delta >= ALTERNATIVE_MARGIN or not swap.plausible:
                return None
        return Alternative(score.candidate.name, delta, settings)

    def _in_place_of(self, fit: Fit, name: str) -> tuple[Fit, list[ScoreTest]]:
        """`fit` without `name`, and the score tests of all candidates beside that."""
        key = fit.identity, name
        if key not in self._in_place:
            reduced = self._fits.without(fit, name)
            simulated = self._screening.has_scores_at(reduced)
            scores = self._screening.scores(reduced, reduced if simulated else self._fits.null)
            switched_off = self._fits.switched_off(fit, name)
            if reduced.rss < _ABSORBED * switched_off.rss:
                scores = self._screening.with_starts_from(switched_off, reduced, scores)
            self._in_place[key] = reduced, scores
        return self._in_place[key]


def _rss_limit(fit: Fit) -> float:
    """The sum of squares from which on no alternative to an effect of `fit` is as good."""
    return fit.rss + OUT_OF_REACH * fit.noise_variance


def _plausible(score: ScoreTest) -> bool:
    """True if the size that the signature asks for is plausible, its error allowed for."""
    if not score.starts:
        return False
    values = score.starts[0][score.candidate.name]
    error = _CLEARLY_IMPLAUSIBLE / math.sqrt(max(score.predicted_reduction, 1.0))
    return not any(
        p.beyond(values[p.name]) > error * abs(values[p.name]) for p in score.candidate.parameters
    )


def _nests_prediction(wider: Fit, fit: Fit) -> bool:
    """True if `wider` has more parameters and predicts the same, as far as noise tells.

    It is then the same explanation with parameters to spare, and no alternative.
    """
    extra = len(wider.order) + wider.searched - len(fit.order) - fit.searched
    if extra <= 0:
        return False
    difference = wider.residual - fit.residual
    scale = 1.0 if fit.known_noise else fit.rss / fit.count
    chi2 = float(difference @ difference) / scale
    return chi2 < float(stats.chi2.ppf(_NESTED_LEVEL, extra))
