"""Which effects, if any: signatures, shortlist, forward and backward steps, held-out parts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mopro.diagnosis.fit import Fit, fit, probes
from mopro.diagnosis.model import Candidate, Floats, Mask, Settings
from mopro.diagnosis.residual import Residuals

_SHORTLIST = 6
_BEAM = 3
_MOST_EFFECTS = 3
_STARTS_KEPT = 2
# A rival that explains as well as this much in chi-squared cannot be told apart.
RIVAL_MARGIN = 10.0


@dataclass(frozen=True)
class Scored:
    """A candidate's promise: the drop in chi-squared that its signature predicts.

    `starts` are the settings that fit best along the signatures.
    """

    candidate: Candidate
    gain: float
    starts: tuple[Settings, ...]


@dataclass(frozen=True)
class HeldOut:
    """Misfit of parts that were not fitted: mean square of the whitened residual."""

    before: float
    after: float
    without: dict[str, float]

    def supports(self, effect: str) -> bool:
        """Whether the held-out parts fit better with `effect` than without it."""
        return self.after < self.without[effect]


class Search:
    """Looks through a catalogue for the effects that account for a residual."""

    def __init__(self, residuals: Residuals, catalogue: Sequence[Candidate]) -> None:
        self.residuals = residuals
        self.catalogue = tuple(catalogue)
        self._fits: dict[frozenset[str], Fit] = {}

    @property
    def null(self) -> Fit:
        return self.fitted((), [{}])

    def cost(self, found: Fit) -> float:
        return found.cost(len(self.catalogue))

    def fitted(self, candidates: Sequence[Candidate], starts: Sequence[Settings]) -> Fit:
        """The fit of a set of effects; each set is fitted once."""
        key = frozenset(candidate.name for candidate in candidates)
        if key not in self._fits:
            self._fits[key] = fit(self.residuals, candidates, starts)
        return self._fits[key]

    # -- signatures ------------------------------------------------------------

    def scores(self, base: Fit) -> list[Scored]:
        """All candidates not in `base`, the most promising first (score test)."""
        others = [c for c in self.catalogue if c.name not in base.names]
        tangent, _ = np.linalg.qr(base.jacobian)
        scored = [self._score(base, tangent, candidate) for candidate in others]
        return sorted(scored, key=lambda s: -s.gain)

    def _score(self, base: Fit, tangent: Floats, candidate: Candidate) -> Scored:
        """Each probe's signature, free in size, against what `base` leaves."""
        trials: list[tuple[float, Settings]] = []
        for probe in probes(candidate):
            moved = base.residual - self.residuals.at({**base.settings, **probe})
            signature = moved - tangent @ (tangent.T @ moved)
            strength = float(signature @ signature)
            if strength <= 0:
                continue
            size = float(signature @ base.residual) / strength
            start = _resized(candidate, probe, size)
            trials.append((size**2 * strength if start else 0.0, start or probe))
        trials.sort(key=lambda trial: -trial[0])
        best = trials[0][0] if trials else 0.0
        return Scored(candidate, best, tuple(start for _, start in trials[:_STARTS_KEPT]))

    # -- steps -----------------------------------------------------------------

    def run(self) -> Fit:
        """The cheapest set of effects by forward steps of a beam, then backward."""
        best, beam = self.null, [self.null]
        for _ in range(_MOST_EFFECTS):
            grown = {f.names: f for base in beam for f in self._extended(base)}
            beam = sorted(grown.values(), key=self.cost)[:_BEAM]
            if not beam or self.cost(beam[0]) >= self.cost(best):
                break
            best = beam[0]
        return self._pruned(best)

    def _extended(self, base: Fit) -> Iterator[Fit]:
        for scored in self.scores(base)[:_SHORTLIST]:
            if scored.starts:
                starts = [{**base.settings, **start} for start in scored.starts]
                yield self.fitted((*base.candidates, scored.candidate), starts)

    def _pruned(self, found: Fit) -> Fit:
        """`found` without the effects that do not pay for themselves."""
        while found.candidates:
            cheaper = min((self.without(found, name) for name in found.names), key=self.cost)
            if self.cost(cheaper) > self.cost(found):
                break
            found = cheaper
        return found

    def without(self, found: Fit, name: str) -> Fit:
        kept = tuple(c for c in found.candidates if c.name != name)
        return self.fitted(kept, [{c.name: found.settings[c.name] for c in kept}])

    def rivals(self, found: Fit, name: str) -> list[tuple[str, float]]:
        """Effects that do as well in the place of `name`, and how much worse they fit."""
        rest = self.without(found, name)
        as_good = []
        for scored in self.scores(rest):
            if scored.candidate.name == name or not scored.starts:
                continue
            starts = [{**rest.settings, **start} for start in scored.starts]
            swapped = self.fitted((*rest.candidates, scored.candidate), starts)
            worse = misfit(swapped) - misfit(found)
            as_well = worse < RIVAL_MARGIN and not swapped.at_bound()
            if as_well and not _contains(swapped, found):
                as_good.append((scored.candidate.name, worse))
        return sorted(as_good, key=lambda rival: rival[1])

    # -- held out --------------------------------------------------------------

    def held_out(self, found: Fit) -> HeldOut:
        """Each fold predicted by a fit of the others, with and without each effect."""
        folds = list(_folds(self.residuals))
        sets = {name: self.without(found, name) for name in found.names}
        return HeldOut(
            before=_misfit_of_folds(self.residuals, self.null, folds),
            after=_misfit_of_folds(self.residuals, found, folds),
            without={n: _misfit_of_folds(self.residuals, f, folds) for n, f in sets.items()},
        )


def _contains(wider: Fit, found: Fit) -> bool:
    """Whether `wider` has more parameters and comes down to the same prediction.

    Then it is no other explanation, only a roomier one.
    """
    extra = len(wider.order) - len(found.order)
    if extra <= 0:
        return False
    apart = wider.residual - found.residual
    scale = 1.0 if found.known_noise else found.rss / found.count
    return float(apart @ apart) / scale < float(stats.chi2.ppf(0.999, extra))


def misfit(found: Fit) -> float:
    """-2 log likelihood but for a constant."""
    if found.known_noise:
        return found.rss
    return found.count * math.log(max(found.rss, 1e-300) / found.count)


def _resized(candidate: Candidate, probe: Settings, size: float) -> Settings | None:
    """`probe` with its amplitudes times `size`, or None if that leaves their ranges."""
    values = dict(probe[candidate.name])
    for parameter in candidate.parameters:
        if parameter.amplitude:
            values[parameter.name] *= size
            slack = 0.05 * (parameter.high - parameter.low)
            if not parameter.low - slack <= values[parameter.name] <= parameter.high + slack:
                return None
    return {candidate.name: values}


def _folds(residuals: Residuals) -> Iterator[Mask]:
    """Masks of the parts to hold out: a run's moves, or whole runs, whichever are given."""
    labels = []
    for index, series in enumerate(residuals.data):
        own = np.full(len(series), index) if series.folds is None else series.folds
        labels.append(own)
    joined = np.concatenate(labels)
    for label in np.unique(joined):
        yield joined == label


def _misfit_of_folds(residuals: Residuals, found: Fit, folds: Sequence[Mask]) -> float:
    total = 0.0
    for mask in folds:
        settings: Settings = {}
        if found.candidates:
            training = residuals.subset(~mask)
            settings = fit(training, found.candidates, [found.settings]).settings
        left = residuals.subset(mask).at(settings)
        total += float(left @ left)
    return total / sum(int(mask.sum()) for mask in folds)
