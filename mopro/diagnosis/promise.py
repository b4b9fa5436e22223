"""What candidates promise beside a fit, by their signatures, before any is fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mopro.diagnosis.fit import Fit, choice_price, price
from mopro.diagnosis.fits import Fits, Identity
from mopro.diagnosis.model import Candidate, Role
from mopro.diagnosis.signature import (
    Group,
    Scored,
    far_from_probes,
    probed_at,
    score,
    signatures,
    sought,
)

# An effect that is no dearer than this (chi-squared and price) cannot be told apart.
RIVAL_MARGIN = 10.0
# How far a signature may misjudge what a fit will gain, as a share of that gain.
MISJUDGED = 0.02
# Where a signature promises this much, at a size far from the one that it was taken at,
# one is taken there.
_WORTH_ANOTHER_LOOK = 6.0
# A residual this many times as large as noise may be too far off for signatures to rank.
_ROUGHLY = 100.0


def rough(found: Fit) -> bool:
    """Whether so much is left that signatures may mislead."""
    return found.rss > _ROUGHLY * found.count


class Promises:
    """Scores the catalogue of `fits`; a signature is simulated once for each fit it is at."""

    def __init__(self, fits: Fits) -> None:
        self._fits = fits
        self._scores: dict[tuple[Identity, Identity], list[Scored]] = {}
        self._groups: dict[tuple[Identity, tuple[str, str]], list[Group]] = {}

    def scores(self, base: Fit, at: Fit | None = None) -> list[Scored]:
        """All candidates that may join `base`, the most promising first (score test).

        Signatures are those at `at`, which is `base` itself unless given: those at a fit
        nearby cost no simulation.
        """
        key = base.identity, (at or base).identity
        if key not in self._scores:
            self._scores[key] = self._scored(base, at or base)
        return self._scores[key]

    def taken_at(self, base: Fit) -> bool:
        """Whether signatures at `base` itself are known already."""
        return (base.identity, base.identity) in self._scores

    def fresh(self, base: Fit) -> list[Scored]:
        """As `scores`, signatures taken anew for those that those at the null speak for.

        Where the null is far off its signatures speak for nobody, and all are taken anew.
        """
        if base.key == self._fits.null.key or rough(self._fits.null):
            return self.scores(base)
        known = self.scores(base, self._fits.null)
        limit = self._fits.cost(base) + RIVAL_MARGIN
        hopeful = [s.candidate for s in known if self.predicted(base, s) < limit]
        kept = [s for s in known if s.candidate not in hopeful]
        return [*self._weighed(base, base, hopeful), *kept]

    def sought_in(self, left_by: Fit, base: Fit, known: Sequence[Scored]) -> list[Scored]:
        """`known` beside `base`; what has to be looked for is looked for in another fit as well."""
        tangent, _ = np.linalg.qr(base.jacobian)

        def better(own: Scored) -> Scored:
            groups = sought(self._fits.residuals, left_by, own.candidate)
            other = score(base, tangent, own.candidate, groups)
            return max(own, other, key=lambda s: s.gain)

        found = self._fits.each(better, known)
        return sorted(found, key=lambda s: self.predicted(base, s))

    def _scored(self, base: Fit, at: Fit) -> list[Scored]:
        others = [
            c
            for c in self._fits.catalogue
            if c.name not in base.names and (c.refines is None or c.by_itself)
        ]
        return self._weighed(base, at, others)

    def _weighed(self, base: Fit, at: Fit, candidates: Sequence[Candidate]) -> list[Scored]:
        tangent, _ = np.linalg.qr(base.jacobian)

        def scored(candidate: Candidate) -> Scored:
            groups = self._signatures(at, candidate)
            groups = [*groups, *sought(self._fits.residuals, base, candidate)]
            first = score(base, tangent, candidate, groups)
            if first.gain < _WORTH_ANOTHER_LOOK or not far_from_probes(first):
                return first
            closer = probed_at(self._fits.residuals, at, candidate, first.starts[0])
            return score(base, tangent, candidate, [*groups, closer])

        found = self._fits.each(scored, candidates)
        return sorted(found, key=lambda s: self.predicted(base, s))

    def closer(self, base: Fit, scored: Scored) -> Scored:
        """`scored` by a signature at the best start itself, where that promises more."""
        candidate = scored.candidate
        if not any(p.role is Role.AMPLITUDE for p in candidate.parameters):
            return scored
        tangent, _ = np.linalg.qr(base.jacobian)
        probe = probed_at(self._fits.residuals, base, candidate, scored.starts[0])
        return max(scored, score(base, tangent, candidate, [probe]), key=lambda s: s.gain)

    def expected_sigmas(self, at: Fit, candidate: Candidate) -> float | None:
        """How strong the largest effect to expect would be, or None if nobody can say.

        That is possible for a single amplitude, to which the response is proportional, if
        it does not have to be looked for.
        """
        amplitudes = [p for p in candidate.parameters if p.role is Role.AMPLITUDE]
        if len(amplitudes) != 1 or candidate.seek is not None:
            return None
        parameter = amplitudes[0]
        ends = parameter.plausible or (parameter.low, parameter.high)
        strongest = 0.0
        for group in self._signatures(at, candidate):
            probed = group[0].values[parameter.name]
            own = max(float(np.linalg.norm(probe.change)) for probe in group)
            sizes = (abs(parameter.size(end, of=probed)) for end in ends)
            strongest = max(strongest, own * max(sizes))
        return strongest

    def _signatures(self, at: Fit, candidate: Candidate) -> list[Group]:
        key = (at.identity, candidate.key)
        if key not in self._groups:
            self._fits.progress(f"the signature of {candidate.name}")
            self._groups[key] = signatures(self._fits.residuals, at, candidate)
        return self._groups[key]

    def predicted(self, base: Fit, scored: Scored) -> float:
        """The cost that `base` and a candidate together promise to come to."""
        left = max(base.rss - scored.gain, 1e-300)
        misfit = left if base.known_noise else base.count * math.log(left / max(base.count, 1))
        return self._fits.cost(base) - base.misfit + misfit + self.dearer(base, scored.candidate)

    def priced(self, base: Fit, members: Sequence[Scored]) -> float:
        """What `base` and `members` cost besides their misfit."""
        joined = [member.candidate for member in members]
        return self._fits.cost(base) - base.misfit + self._dearer(base, joined)

    def dearer(self, base: Fit, candidate: Candidate) -> float:
        """What a candidate must gain in chi-squared beside `base` to pay for itself."""
        return self._dearer(base, [candidate])

    def _dearer(self, base: Fit, joined: Sequence[Candidate]) -> float:
        own = sum(price(p, base.count) for candidate in joined for p in candidate.parameters)
        pool = len(self._fits.catalogue)
        together = base.chosen + sum(not candidate.calibrates for candidate in joined)
        return own + choice_price(together, pool) - choice_price(base.chosen, pool)
