"""Screening of the catalogue beside a fit, by score tests, before any candidate is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mopro.diagnosis.fit import Fit, choice_penalty, parameter_penalty
from mopro.diagnosis.fit_cache import FitCache, Identity
from mopro.diagnosis.model import Candidate, Role
from mopro.diagnosis.signature import (
    Group,
    ScoreTest,
    far_from_probes,
    probed_at,
    score_test,
    searched,
    signatures,
)
from mopro.diagnosis.ties import lowest_first

# EBIC within which two explanations cannot be told apart: a Bayes factor of 150, above which
# evidence is "very strong" (Kass and Raftery 1995). Halved, families lose true members at odds of
# 12 to 1; doubled, they gain members at odds of up to 22000 to 1.
ALTERNATIVE_MARGIN = 10.0
# Error of the reduction of chi-squared that a signature predicts, as a share of it.
LINEARITY_ERROR = 0.02
# Predicted reduction of chi-squared from which on a signature is simulated again at the size that
# it asks for, if that is far from the size it was simulated at. An effect must gain more than ln n
# anyway: halved, it costs simulations of what is noise.
_WORTH_RELINEARISING = 6.0
# Chi-squared per sample above which the model may be too far from the data for signatures, which
# are linear, to rank candidates.
_FAR_FROM_LINEAR = 100.0
# Smallest sum of squares that is predicted.
_TINY = 1e-300


def far_from_linear(fit: Fit) -> bool:
    """True if the residual is so large (10 σ RMS) that signatures may mislead."""
    return fit.rss > _FAR_FROM_LINEAR * fit.count


class Screening:
    """Score tests of the catalogue of `fits`; each signature is simulated once for each fit."""

    def __init__(self, fits: FitCache) -> None:
        self._fits = fits
        self._scores: dict[tuple[Identity, Identity], list[ScoreTest]] = {}
        self._groups: dict[tuple[Identity, tuple[str, str]], list[Group]] = {}

    def scores(self, base: Fit, at: Fit | None = None) -> list[ScoreTest]:
        """Score tests of all candidates that may join `base`, the lowest predicted EBIC first.

        Signatures are those at the fit `at`, which is `base` unless given: those at another fit
        may be known already and so cost no simulation.
        """
        key = base.identity, (at or base).identity
        if key not in self._scores:
            self._scores[key] = self._all_scores(base, at or base)
        return self._scores[key]

    def has_scores_at(self, base: Fit) -> bool:
        """True if the signatures at `base` itself are known already."""
        return (base.identity, base.identity) in self._scores

    def relinearised(self, base: Fit) -> list[ScoreTest]:
        """As `scores`, with signatures at `base` for the candidates that may pay for themselves.

        Which those are is told by the signatures at the null model, unless that is far from
        linear: then all are simulated at `base`.
        """
        if base.key == self._fits.null.key or far_from_linear(self._fits.null):
            return self.scores(base)
        known = self.scores(base, self._fits.null)
        limit = self._fits.ebic(base) + ALTERNATIVE_MARGIN
        promising = [s.candidate for s in known if self.predicted_ebic(base, s) < limit]
        others = [s for s in known if s.candidate not in promising]
        return [*self._scores_of(base, base, promising), *others]

    def with_starts_from(
        self, other: Fit, base: Fit, scores: Sequence[ScoreTest]
    ) -> list[ScoreTest]:
        """`scores` beside `base`, with starts searched in the residual of `other` as well."""
        tangent, _ = np.linalg.qr(base.jacobian)

        def better(score: ScoreTest) -> ScoreTest:
            groups = searched(self._fits.residuals, other, score.candidate)
            another = score_test(base, tangent, score.candidate, groups)
            return max(score, another, key=lambda s: s.predicted_reduction)

        return self._sorted(base, self._fits.each(better, scores))

    def _all_scores(self, base: Fit, at: Fit) -> list[ScoreTest]:
        others = [
            c
            for c in self._fits.catalogue
            if c.name not in base.names and (c.extends is None or c.can_enter_first)
        ]
        return self._scores_of(base, at, others)

    def _scores_of(self, base: Fit, at: Fit, candidates: Sequence[Candidate]) -> list[ScoreTest]:
        tangent, _ = np.linalg.qr(base.jacobian)

        def scored(candidate: Candidate) -> ScoreTest:
            groups = self._signatures(at, candidate)
            groups = [*groups, *searched(self._fits.residuals, base, candidate)]
            first = score_test(base, tangent, candidate, groups)
            if first.predicted_reduction < _WORTH_RELINEARISING or not far_from_probes(first):
                return first
            closer = probed_at(self._fits.residuals, at, candidate, first.starts[0])
            return score_test(base, tangent, candidate, [*groups, closer])

        return self._sorted(base, self._fits.each(scored, candidates))

    def _sorted(self, base: Fit, scores: Sequence[ScoreTest]) -> list[ScoreTest]:
        return lowest_first(
            scores,
            lambda s: self.predicted_ebic(base, s),
            lambda s: self._fits.place(s.candidate),
        )

    def at_its_start(self, base: Fit, score: ScoreTest) -> ScoreTest:
        """The score test by a signature at the best start itself, where that predicts more."""
        candidate = score.candidate
        if not any(p.role is Role.AMPLITUDE for p in candidate.parameters):
            return score
        tangent, _ = np.linalg.qr(base.jacobian)
        group = probed_at(self._fits.residuals, base, candidate, score.starts[0])
        closer = score_test(base, tangent, candidate, [group])
        return max(score, closer, key=lambda s: s.predicted_reduction)

    def expected_sigmas(self, at: Fit, candidate: Candidate) -> float | None:
        """Size of the largest plausible effect, in standard deviations of the noise.

        That of the whole change, the root of its chi-squared. None unless the effect has a
        single amplitude, to which the response is proportional, and no search for starts.
        """
        amplitudes = [p for p in candidate.parameters if p.role is Role.AMPLITUDE]
        if len(amplitudes) != 1 or candidate.find_starts is not None:
            return None
        parameter = amplitudes[0]
        ends = parameter.plausible or (parameter.low, parameter.high)
        strongest = 0.0
        for group in self._signatures(at, candidate):
            probed = group[0].values[parameter.name]
            own = max(float(np.linalg.norm(probe.change)) for probe in group)
            factors = (abs(parameter.factor(end, of=probed)) for end in ends)
            strongest = max(strongest, own * max(factors))
        return strongest

    def _signatures(self, at: Fit, candidate: Candidate) -> list[Group]:
        key = (at.identity, candidate.key)
        if key not in self._groups:
            self._fits.progress(f"simulating the signature of {candidate.name}")
            self._groups[key] = signatures(self._fits.residuals, at, candidate)
        return self._groups[key]

    def predicted_ebic(self, base: Fit, score: ScoreTest) -> float:
        """Predicted EBIC of `base` with a candidate added."""
        deviance = base.deviance_of(max(base.rss - score.predicted_reduction, _TINY))
        ebic = self._fits.ebic(base)
        return ebic - base.deviance + deviance + self.penalty(base, [score.candidate])

    def total_penalty(self, base: Fit, members: Sequence[ScoreTest]) -> float:
        """Predicted EBIC of `base` with `members` added, less their deviance."""
        joined = [member.candidate for member in members]
        return self._fits.ebic(base) - base.deviance + self.penalty(base, joined)

    def penalty(self, base: Fit, joined: Sequence[Candidate]) -> float:
        """Fall of the deviance that candidates must bring beside `base` for EBIC to fall."""
        own = sum(
            parameter_penalty(p, base.count) for candidate in joined for p in candidate.parameters
        )
        size = len(self._fits.catalogue)
        together = base.findings + sum(not candidate.calibrates for candidate in joined)
        return own + choice_penalty(together, size) - choice_penalty(base.findings, size)
