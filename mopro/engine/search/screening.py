"""Screening of the catalogue beside a fit, by score tests, before any candidate is fitted."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from operator import attrgetter
from threading import Lock

import numpy as np
from cachetools import LRUCache, cachedmethod

from mopro.engine.assumed import FITTED, LINEARITY_ERROR, STRONG, VERY_STRONG
from mopro.engine.candidate import Candidate, Role
from mopro.engine.fits import Fit
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.linear_subset import LinearSubset, LinearSubsets
from mopro.engine.search.signature import (
    Group,
    ScoreTest,
    alike,
    beside,
    far_from_probes,
    probed_at,
    score_test,
    searched,
    signatures,
    unabsorbed,
)


def _asked(screening: Screening, base: Fit, at: Fit, candidate: Candidate) -> Hashable:
    return base.identity, _at(screening, at, candidate)


def _at(screening: Screening, at: Fit, candidate: Candidate) -> Hashable:
    return screening._hypotheses.null.identity, at.identity, candidate.key


def _bytes_of_groups(groups: Sequence[Group]) -> int:
    return sum(probe.change.nbytes for group in groups for probe in group)


def _bytes_of(score: ScoreTest) -> int:
    return score.explained.nbytes + _bytes_of_groups([score.group])


# Bytes of arrays that each cache keeps: the null model, and what is left of the best set without
# each of its effects, are asked for again in every round.
_KEPT_BYTES = 1 << 27
# Bases whose subsets are kept: those of one neighbourhood, which the alternatives ask for again.
# Halved, those of a set of four effects are predicted twice.
_KEPT_BASES = 16


class Screening:
    """Score tests of the catalogue of `sets`; each signature is simulated once for each fit."""

    def __init__(self, hypotheses: Hypotheses) -> None:
        self._hypotheses = hypotheses
        # Asked by several threads at once.
        self._lock = Lock()
        self._tests: LRUCache[Hashable, ScoreTest] = LRUCache(_KEPT_BYTES, _bytes_of)
        self._subsets: LRUCache[Hashable, list[LinearSubset]] = LRUCache(_KEPT_BASES)
        self._groups: LRUCache[Hashable, list[Group]] = LRUCache(_KEPT_BYTES, _bytes_of_groups)
        self._searched: LRUCache[Hashable, list[Group]] = LRUCache(_KEPT_BYTES, _bytes_of_groups)

    def on(self, hypotheses: Hypotheses) -> Screening:
        """Screening of a copy of these sets, with the signatures that are known here."""
        own = Screening(hypotheses)
        own._lock, own._tests, own._subsets = self._lock, self._tests, self._subsets
        own._groups, own._searched = self._groups, self._searched
        return own

    def beside(self, base: Fit, at: Fit) -> list[ScoreTest]:
        """Score tests of all candidates that may join `base`, the lowest predicted EBIC first.

        Signatures are those at the null model. If `base` is `at` itself and leaves more than
        noise, they are simulated there: beside a dry friction, another one has quite another
        signature. If it leaves noise, what joins it is weak, and the best of the known probes
        are: of the likeliest candidates that may come within the margin of alternatives, and of
        all where the null model is far from linear. A free-form term that takes the place of a
        single effect of such a set is simulated beside the others, as it may be that one of them
        has another form: a damping in the presliding of a friction is nothing without that.
        """
        null = self._hypotheses.null
        joining = self.joining(base)
        if base.key != at.key:
            laws = [c for c in joining if c.law and self._substitutes(base, at)]
            others = [c for c in joining if c not in laws]
            scores = [*self.of(base, laws), *self.of(base, others, null)]
            return self._sorted(base, scores)
        if at.key == null.key or not self._hypotheses.is_noise(at):
            return self.of(base, joining, at)
        known = self.of(base, joining, null)
        limit = self._hypotheses.white.ebic(at) + VERY_STRONG
        likely = sum(self.predicted_ebic(base, s) < limit for s in known)
        count = len(known) if null.far_from_linear else min(likely, 2 * FITTED)
        closer = self._hypotheses.each(lambda score: self._closer(base, score), known[:count])
        return self._sorted(base, [*closer, *known[count:]])

    def joining(self, base: Fit) -> list[Candidate]:
        """The candidates that may join `base`: not in it, in forms that need no plainer one."""
        return [
            c
            for c in self._hypotheses.catalogue
            if c.name not in base.names and (c.extends is None or c.can_enter_first)
        ]

    def subsets(self, base: Fit, at: Fit, most: int) -> list[LinearSubset]:
        """Subsets of up to `most` candidates `beside` base, the lowest predicted EBIC first.

        Beside the null model, and beside a set that is expanded again, they are known.
        """
        hypotheses = self._hypotheses
        there = at.identity if base.key == at.key else self._substitutes(base, at)
        known = tuple(c.key for c in hypotheses.catalogue), hypotheses.white.noise.stated
        key = (hypotheses.null.identity, base.identity, there, most, known)
        if key not in self._subsets:
            scores = self.beside(base, at)
            self._subsets[key] = LinearSubsets(base, scores, hypotheses.white).best(most)
        return self._subsets[key]

    def _substitutes(self, base: Fit, at: Fit) -> bool:
        """True if what joins `base` takes the place of one of several effects that leave noise."""
        return 0 < len(base.candidates) == len(at.candidates) - 1 and self._hypotheses.is_noise(at)

    def _closer(self, at: Fit, known: ScoreTest) -> ScoreTest:
        """A score test at the null model with the best of its probes simulated at `at`."""
        again = beside(self._hypotheses.residuals, at, known.candidate, known.group)
        groups = [*([again] if again else []), *self._found(at, known.candidate)]
        return score_test(at, known.candidate, groups)

    @cachedmethod(attrgetter("_tests"), key=_asked, lock=attrgetter("_lock"))
    def _score(self, base: Fit, at: Fit, candidate: Candidate) -> ScoreTest:
        groups, residuals = list(self._signatures(at, candidate)), self._hypotheses.residuals
        groups += [g for own in groups for g in unabsorbed(residuals, at, base, candidate, own)]
        groups += self._found(base, candidate)
        first = score_test(base, candidate, groups)
        # Beside a set that lost an effect, less than the prediction of what is left is off by.
        error = 0.0 if base.key == at.key else LINEARITY_ERROR * (base.rss - base.count)
        if first.predicted_reduction < max(STRONG, error) or not far_from_probes(first):
            return first
        closer = probed_at(residuals, at, candidate, first.starts[0])
        return score_test(base, candidate, [*groups, closer])

    def of(
        self, base: Fit, candidates: Sequence[Candidate], at: Fit | None = None
    ) -> list[ScoreTest]:
        """Score tests of `candidates` beside `base`, the lowest predicted EBIC first.

        By signatures at `at`, which is `base` unless stated.
        """
        scores = self._hypotheses.each(lambda c: self._score(base, at or base, c), candidates)
        return self._sorted(base, scores)

    def _sorted(self, base: Fit, scores: Sequence[ScoreTest]) -> list[ScoreTest]:
        return sorted(scores, key=lambda s: self.predicted_ebic(base, s))

    def at_its_start(self, base: Fit, score: ScoreTest) -> ScoreTest:
        """The score test by a signature at the best start itself, where that predicts more."""
        amplitudes = [p for p in score.candidate.parameters if p.role is Role.AMPLITUDE]
        own = score.starts[0][score.candidate.name]
        if not amplitudes or own[amplitudes[0].name] == amplitudes[0].null:
            return score
        group = probed_at(self._hypotheses.residuals, base, score.candidate, score.starts[0])
        closer = score_test(base, score.candidate, [group])
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

    def listed_like(self, law: Candidate) -> set[tuple[str, str]]:
        """Keys of the listed effects that do what a free-form term does: their signatures are one.

        Those that do more with it are among them, as a friction with Stribeck's peak.
        """
        null, listed = self._hypotheses.null, [c for c in self._hypotheses.catalogue if not c.law]
        own = self._signatures(null, law)
        same = [
            candidate
            for candidate in listed
            for group in self._signatures(null, candidate)
            for other in group
            for (one, *_) in own
            if alike(one, other)
        ]
        return {c.key for c in listed for o in same if c is o or c.nests(o)}

    def predicted_ebic(self, base: Fit, score: ScoreTest) -> float:
        """Predicted EBIC of `base` with a candidate added, for white noise."""
        evidence = self._hypotheses.white
        left = base.residual - score.explained if len(score.explained) else base.residual
        deviance = evidence.noise.deviance(left)
        return deviance + evidence.penalty(base) + evidence.added_penalty(base, [score.candidate])

    @cachedmethod(attrgetter("_groups"), key=_at, lock=attrgetter("_lock"))
    def _signatures(self, at: Fit, candidate: Candidate) -> list[Group]:
        self._hypotheses.progress(f"simulating the signature of {candidate.name}")
        return signatures(self._hypotheses.residuals, at, candidate)

    @cachedmethod(attrgetter("_searched"), key=_at, lock=attrgetter("_lock"))
    def _found(self, base: Fit, candidate: Candidate) -> list[Group]:
        """Starts from the candidate's own search in the residual of `base`."""
        return searched(self._hypotheses.residuals, self._hypotheses.null, base, candidate)
