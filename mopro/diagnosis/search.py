"""Which effects, if any: sets by their sketches or one by one, then pruned and swapped."""

from __future__ import annotations

import math

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fits import Fits
from mopro.diagnosis.promise import MISJUDGED, RIVAL_MARGIN, Promises, rough
from mopro.diagnosis.remainder import examine
from mopro.diagnosis.rivals import OUT_OF_REACH, Rivals
from mopro.diagnosis.signature import Scored
from mopro.diagnosis.sketch import Sketch, Sketcher, distinct

_SHORTLIST = 10
_FITTED_SETS = 3
# As many however many jobs there are: what is found must not hang on that.
_FITTED_TO_THE_END = 2
_MOST_EFFECTS = 3
_MOST_STEPS = 6
_FORMS_OF_A_NAME = 2
_MOST_SWAPS = 3
# What a single effect leaves at most, as a share, for the others to be a matter of detail.
_NEXT_TO_NOTHING = 0.02
_MOST_BEGINNINGS = 2
# What an effect promises at least, as a share of what several gain, to be tried in their place,
# and how many are.
_MOST_OF_IT = 0.5
_INSTEAD = 4
# A rival that is cheaper by less is as good, and may as well stay a rival.
_WORTH_A_SWAP = 2.0
# What an effect must pay beyond its price to be named: odds of 10 to 1.
_WORTH_A_NAME = 2 * math.log(10)
# What an effect costs at most that a rival of another one makes superfluous.
_PRICE_OF_ONE = 30.0


class Search:
    """Looks through the catalogue of `fits` for the effects that account for its residual."""

    def __init__(self, fits: Fits) -> None:
        self.fits = fits
        self.promises = Promises(fits)
        self.rivals = Rivals(fits, self.promises)

    def run(self) -> Fit:
        """The cheapest set of effects that is found, each of which is worth its name."""
        return self.fits.pruned(self._cheapest(), _WORTH_A_NAME)

    def _cheapest(self) -> Fit:
        """The cheapest set of effects that steps forward, swaps and steps back lead to.

        Where signatures can be trusted whole sets are weighed by them, and the best are
        fitted; far from the data single effects are fitted instead. A single effect that
        promises to account for nearly all is tried before any set is.
        """
        alone = self._alone()
        if alone.candidates and self._settled(alone):
            return alone
        found = self._grown(self.fits.null)
        if rough(self.fits.null) and not self._explained(found):
            for other in self._other_beginnings(found):
                found = min(found, self._grown(other), key=self.fits.cost)
                if self._explained(found):
                    break
        return self.exchanged(self._one_for_several(found))

    def _grown(self, base: Fit) -> Fit:
        """The cheapest set that steps forward from `base`, swaps and steps back lead to."""
        found = base
        for _ in range(_MOST_STEPS):
            grown = self._extended(base) if rough(base) else self._sketched(base)
            # One after the other: whose fit of a set they share comes first must not be chance.
            freed = map(self.fits.refined, self._distinct(grown))
            best = min([*grown, *freed], key=self.fits.cost, default=found)
            best = self.fits.pruned(best)
            if self.fits.cost(best) >= self.fits.cost(found):
                if base is found or not rough(found):
                    break
                # Where much is left yet, even what explains less than that may be there.
                base = found
                continue
            found = best
            if self._settled(found):
                break
            base = self._swapped(self._core(found))
            found = min(found, base, key=self.fits.cost)
        return self._swapped(found)

    def _distinct(self, fits: list[Fit]) -> list[Fit]:
        """Those that leave something else each, the cheapest of twins."""
        kept: list[Fit] = []
        for fit in sorted(fits, key=self.fits.cost):
            apart = (float(np.sum((fit.residual - k.residual) ** 2)) for k in kept)
            if all(distance > RIVAL_MARGIN * fit.variance for distance in apart):
                kept.append(fit)
        return kept

    def _other_beginnings(self, found: Fit) -> list[Fit]:
        """Single effects that account for nearly all by themselves, and were left for others.

        What mimics a strong effect to a thousandth may do so better than the effect itself does
        as long as others are missing, and then no step leads from the one to the other.
        """
        null = self.fits.null
        alone = [
            fit
            for fit in self._extended(null)
            if fit.rss < _NEXT_TO_NOTHING * null.rss and not fit.names <= found.names
        ]
        return sorted(alone, key=self.fits.cost)[:_MOST_BEGINNINGS]

    def _one_for_several(self, found: Fit) -> Fit:
        """`found`, or a single effect in the place of all of it or of all but one.

        Where a response bends, its signature promises less than several others add up to.
        """
        beginnings = [self.fits.null] if len(found.candidates) > 1 else []
        if len(found.candidates) > 2:
            beginnings += [self._only(found, name) for name in sorted(found.names)]
        limit = self.fits.no_dearer(found, OUT_OF_REACH)
        fewer = [fit for base in beginnings for fit in self._instead(base, found, limit)]
        freed = [self.fits.refined(fit, limit) for fit in self._distinct(fewer)]
        best = min(freed, key=self.fits.cost, default=found)
        return self._swapped(best) if self.fits.cost(best) < self.fits.cost(found) else found

    def _only(self, found: Fit, name: str) -> Fit:
        """The effect `name` of `found` by itself."""
        for other in sorted(found.names - {name}):
            found = self.fits.without(found, other)
        return found

    def _instead(self, base: Fit, found: Fit, limit: float) -> list[Fit]:
        """`base` with one effect that promises most of what those of `found` gain."""
        enough = _MOST_OF_IT * (base.rss - found.rss)
        others = [
            s
            for s in self.promises.scores(base, self.fits.null)
            if s.starts and s.gain > enough and s.candidate.name not in found.names
        ]
        return self.fits.each(lambda s: self.fits.joined(base, s, limit), others[:_INSTEAD])

    def settled_at(self, found: Fit) -> Fit:
        """The effects of `found`, known from another weighing, as far as they pay in this one."""
        again = self.fits.fitted(found.candidates, [found.settings])
        return self.fits.pruned(self._swapped(self.fits.pruned(again)), _WORTH_A_NAME)

    def _core(self, found: Fit) -> Fit:
        """`found` without the effects that explain less than it leaves over.

        They may only make up for what a wrong one among the others gets wrong.
        """
        for name in sorted(found.names):
            fewer = self.fits.without(found, name, found.rss + found.excess)
            if fewer.rss - found.rss < found.excess:
                return self._core(fewer)
        return found

    def _alone(self) -> Fit:
        """The single effect that promises the most, or its best rival; the null if none may do.

        It must promise to leave next to nothing. A signature misjudges a strong effect by
        more than a second one would gain, and sets are dear to fit that mend nothing else.
        """
        null = self.fits.null
        most = next((s for s in self.promises.scores(null) if s.starts), None)
        if most is None or self.promises.predicted(null, most) >= self.fits.cost(null):
            return null
        if null.excess - most.gain > MISJUDGED * most.gain:
            return null
        return self._swapped(self.fits.pruned(self.fits.refined(self.fits.joined(null, most))))

    def _sketched(self, base: Fit) -> list[Fit]:
        """`base` with the sets of candidates whose signatures promise the most."""
        most = _MOST_EFFECTS - len(base.candidates)
        tangent, _ = np.linalg.qr(base.jacobian)
        sketches = Sketcher(base, tangent, self.promises.fresh(base)).sets(
            most, lambda members: self.promises.priced(base, members)
        )
        worth = [sketch for sketch in sketches if sketch.cost < self.fits.cost(base)]
        return self.fits.each(
            lambda sketch: self._drawn(base, sketch), distinct(worth, _FITTED_SETS)
        )

    def _drawn(self, base: Fit, sketch: Sketch) -> Fit:
        candidates = [member.candidate for member in sketch.members]
        return self.fits.fitted(
            (*base.candidates, *candidates), [{**base.settings, **sketch.start}]
        )

    def _explained(self, found: Fit) -> bool:
        """Whether what is left over is no more than noise."""
        return not examine(self.fits.residuals, found.residual, len(found.order)).significant

    def _settled(self, found: Fit) -> bool:
        """Whether nothing is left over that any candidate promises to account for."""
        if not self._explained(found):
            return False
        scored = self.promises.scores(found, self.fits.null)
        return all(self.promises.predicted(found, s) >= self.fits.cost(found) for s in scored)

    def _extended(self, base: Fit) -> list[Fit]:
        """`base` with each of the candidates that promise to pay for themselves.

        One stands for those that the data cannot tell from it; the others come as its rivals.
        All but the first are given up where they come near neither those nor next to nothing.
        """
        chosen: list[Scored] = []
        for s in self.promises.scores(base) if len(base.candidates) < _MOST_EFFECTS else ():
            forms = sum(c.candidate.name == s.candidate.name for c in chosen)
            worth = s.starts and self.promises.predicted(base, s) < self.fits.cost(base)
            if worth and forms < _FORMS_OF_A_NAME and not any(s.twin_of(c) for c in chosen):
                chosen.append(s)
        first = self.fits.each(lambda s: self.fits.joined(base, s), chosen[:_FITTED_TO_THE_END])
        left = min((fit.rss for fit in first), default=base.rss)
        limit = max(left, _NEXT_TO_NOTHING * base.rss)
        further = chosen[_FITTED_TO_THE_END:_SHORTLIST]
        return [*first, *self.fits.each(lambda s: self.fits.joined(base, s, limit), further)]

    def _swapped(self, found: Fit) -> Fit:
        """`found` with an effect replaced by a rival as long as that is better.

        One may stand for two: beside it an effect that mended a wrong one does not pay.
        """
        for _ in range(_MOST_SWAPS):
            near = self._swaps(found, found.names, _PRICE_OF_ONE)
            lighter = [self.fits.pruned(swap) for swap in near]
            better = min(lighter, key=self.fits.cost, default=found)
            if self.fits.cost(better) > self.fits.cost(found) - _WORTH_A_SWAP:
                break
            found = self.fits.pruned(self.fits.refined(better))
        return found

    def exchanged(self, found: Fit) -> Fit:
        """`found` with two effects replaced at once as long as that is better.

        What mimics one effect pulls along what stands in for another, and then neither is
        better replaced while the other stays.
        """
        for _ in range(_MOST_SWAPS):
            near = self._swaps(found, found.names, OUT_OF_REACH)
            halfway = [fit for fit in self._distinct([found, *near]) if fit.names != found.names]
            both = [
                swap
                for half in halfway
                for swap in self._swaps(half, half.names & found.names, OUT_OF_REACH)
            ]
            better = min(both, key=self.fits.cost, default=found)
            if self.fits.cost(better) > self.fits.cost(found) - _WORTH_A_SWAP:
                break
            found = self._swapped(self.fits.pruned(self.fits.refined(better)))
        return found

    def _swaps(self, found: Fit, names: frozenset[str], dearer: float) -> list[Fit]:
        """`found` with one of `names` replaced by a rival, where that is not `dearer` or more.

        In their order: who fits a set first that two ways lead to must not be chance.
        """
        swaps = [swap for name in sorted(names) for swap in self.rivals.swaps(found, name)]
        near = self.fits.cost(found) + dearer
        return [swap for swap in swaps if self.fits.cost(swap) < near]
