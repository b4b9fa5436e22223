"""Search for the set of effects with the lowest EBIC: forward, backward and swap steps."""

from __future__ import annotations

import math

import numpy as np

from mopro.diagnosis.alternatives import OUT_OF_REACH, Alternatives
from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fit_cache import FitCache
from mopro.diagnosis.linear_subset import LinearSubset, LinearSubsets, distinct
from mopro.diagnosis.remainder import examine
from mopro.diagnosis.screening import (
    ALTERNATIVE_MARGIN,
    LINEARITY_ERROR,
    Screening,
    far_from_linear,
)
from mopro.diagnosis.signature import ScoreTest

# Budgets: each more costs fits, and each fit some ten simulations.
_MOST_EFFECTS = 3
# Single candidates fitted in one forward step.
_SHORTLIST = 10
# Of these the first are fitted to their minimum, the others only if they can come near it. As many
# with any number of jobs: results must not depend on that.
_FITTED_TO_MINIMUM = 2
_FORMS_OF_A_NAME = 2
# Subsets fitted in one forward step.
_FITTED_SUBSETS = 3
_MOST_FORWARD_STEPS = 6
_MOST_SWAPS = 3
# Single effects, besides the first, that the forward search begins with again.
_MOST_RESTARTS = 2
# Candidates tried in the place of several effects.
_MOST_SUBSTITUTES = 4

# Largest share of the sum of squares that a single effect leaves if it is the main one.
_MAIN_EFFECT_LEAVES = 0.02
# Share of what several effects gain that a single one must be predicted to gain, to be tried in
# their place.
_MOST_OF_GAIN = 0.5
# EBIC by which an alternative must be lower to be taken for the effect: a Bayes factor of 2.7,
# "not worth more than a bare mention" (Kass and Raftery 1995) below that.
_SWAP_GAIN = 2.0
# EBIC that an effect must save to be named: a Bayes factor of 10. Doubled, one of 100.
_NAMING_MARGIN = 2 * math.log(10)
# EBIC by which a swap may at first be worse, as it may make one other effect superfluous, whose
# penalty is then saved.
_ONE_PENALTY = 30.0


class Search:
    """Searches the catalogue of `fits` for the effects that account for its residual."""

    def __init__(self, fits: FitCache) -> None:
        self.fits = fits
        self.screening = Screening(fits)
        self.alternatives = Alternatives(fits, self.screening)

    def run(self) -> Fit:
        """The set of effects with the lowest EBIC found, each of which saves 4.6 of it."""
        return self.fits.eliminated(self._lowest(), _NAMING_MARGIN)

    def refitted(self, fit: Fit) -> Fit:
        """The effects of a fit to other noise, fitted to this, with swaps and elimination."""
        same = self.fits.fitted(fit.candidates, [fit.settings])
        return self.fits.eliminated(self._swapped(self.fits.eliminated(same)), _NAMING_MARGIN)

    def _lowest(self) -> Fit:
        """The set with the lowest EBIC that forward, backward and swap steps lead to.

        A single effect that is predicted to account for nearly all is tried before any set.
        Where the null model is far from linear and the search ends with more than noise, it is
        begun again with other single effects.
        """
        single = self._best_single()
        if single.candidates and self._complete(single):
            return single
        best = self._forward(self.fits.null)
        if far_from_linear(self.fits.null) and not self._is_noise(best):
            for start in self._restarts(best):
                best = self.fits.lowest([best, self._forward(start)], best)
                if self._is_noise(best):
                    break
        return self.swapped_in_pairs(self._several_replaced(best))

    # -- forward -----------------------------------------------------------------------

    def _forward(self, base: Fit) -> Fit:
        """The set with the lowest EBIC that forward steps from `base`, each with swaps, lead to."""
        best = base
        for _ in range(_MOST_FORWARD_STEPS):
            step = self._forward_step(base, best)
            if not self.fits.is_lower(step, best):
                if base is best or not far_from_linear(best):
                    break
                # Where the residual is still large, an effect below the excess may be real.
                base = best
                continue
            best = step
            if self._complete(best):
                break
            base = self._swapped(self._above_excess(best))
            best = self.fits.lowest([best, base], best)
        return self._swapped(best)

    def _forward_step(self, base: Fit, best: Fit) -> Fit:
        """`base` with one candidate or one subset more and the best forms, after elimination."""
        steps = self._with_one_more(base) if far_from_linear(base) else self._with_subset(base)
        # In order, not in threads: fits share sets, and which start comes first must not vary.
        in_best_forms = map(self.fits.with_best_forms, self._distinct(steps))
        lowest = self.fits.lowest([*steps, *in_best_forms], default=best)
        return self.fits.eliminated(lowest)

    def _best_single(self) -> Fit:
        """The candidate with the lowest predicted EBIC, or an alternative to it.

        The null model unless the residual beyond it is predicted to be within the linearity
        error: a signature may misjudge a strong effect by more than a second effect would gain,
        and fitting sets that only make up for that takes long.
        """
        null = self.fits.null
        first = next((s for s in self.screening.scores(null) if s.starts), None)
        if first is None or self.screening.predicted_ebic(null, first) >= self.fits.ebic(null):
            return null
        reduction = first.predicted_reduction
        if null.excess - reduction > LINEARITY_ERROR * reduction:
            return null
        fit = self.fits.with_best_forms(self.fits.with_added(null, first))
        return self._swapped(self.fits.eliminated(fit))

    def _with_subset(self, base: Fit) -> list[Fit]:
        """`base` with each of the subsets of the lowest predicted EBIC, if below that of `base`."""
        most = _MOST_EFFECTS - len(base.candidates)
        tangent, _ = np.linalg.qr(base.jacobian)
        subsets = LinearSubsets(base, tangent, self.screening.relinearised(base)).best(
            most, lambda members: self.screening.total_penalty(base, members)
        )
        lower = [subset for subset in subsets if subset.ebic < self.fits.ebic(base)]
        return self.fits.each(
            lambda subset: self._fitted_subset(base, subset), distinct(lower, _FITTED_SUBSETS)
        )

    def _fitted_subset(self, base: Fit, subset: LinearSubset) -> Fit:
        candidates = [member.candidate for member in subset.members]
        return self.fits.fitted(
            (*base.candidates, *candidates), [{**base.settings, **subset.start}]
        )

    def _with_one_more(self, base: Fit) -> list[Fit]:
        """`base` with each of the candidates whose predicted EBIC is below that of `base`.

        Of candidates with the same signature one is fitted; the others follow as alternatives.
        All but the first two are abandoned where they cannot come near those or leave less than
        2 % of the sum of squares.
        """
        shortlist = self._shortlist(base)
        first = self.fits.each(
            lambda s: self.fits.with_added(base, s), shortlist[:_FITTED_TO_MINIMUM]
        )
        lowest_rss = min((fit.rss for fit in first), default=base.rss)
        limit = max(lowest_rss, _MAIN_EFFECT_LEAVES * base.rss)
        further = shortlist[_FITTED_TO_MINIMUM:_SHORTLIST]
        return [*first, *self.fits.each(lambda s: self.fits.with_added(base, s, limit), further)]

    def _shortlist(self, base: Fit) -> list[ScoreTest]:
        """Candidates predicted to lower EBIC, without twins and with two forms of a name at most.

        None beside three effects.
        """
        shortlist: list[ScoreTest] = []
        for s in self.screening.scores(base) if len(base.candidates) < _MOST_EFFECTS else ():
            forms = sum(c.candidate.name == s.candidate.name for c in shortlist)
            lower = s.starts and self.screening.predicted_ebic(base, s) < self.fits.ebic(base)
            if lower and forms < _FORMS_OF_A_NAME and not any(s.twin_of(c) for c in shortlist):
                shortlist.append(s)
        return shortlist

    def _restarts(self, fit: Fit) -> list[Fit]:
        """Single effects, other than those of `fit`, that leave less than 2 % by themselves.

        A mimic of a strong effect may fit better than the effect itself as long as weaker ones
        are missing, and then no swap leads from the one to the other.
        """
        null = self.fits.null
        singles = [
            single
            for single in self._with_one_more(null)
            if single.rss < _MAIN_EFFECT_LEAVES * null.rss and not single.names <= fit.names
        ]
        return self.fits.lowest_first(singles)[:_MOST_RESTARTS]

    # -- backward ----------------------------------------------------------------------

    def _above_excess(self, fit: Fit) -> Fit:
        """`fit` without the effects whose reduction of chi-squared is below its excess.

        They may only compensate for what a wrong effect among the others leaves.
        """
        for name in sorted(fit.names):
            reduced = self.fits.without(fit, name, fit.rss + fit.excess)
            if reduced.rss - fit.rss < fit.excess:
                return self._above_excess(reduced)
        return fit

    # -- swap --------------------------------------------------------------------------

    def _swapped(self, fit: Fit) -> Fit:
        """`fit` with an effect replaced by an alternative, while that lowers EBIC by 2.

        An alternative may stand for two: an effect that made up for a wrong one is eliminated.
        """
        for _ in range(_MOST_SWAPS):
            swaps = self._swaps(fit, fit.names, _ONE_PENALTY)
            eliminated = [self.fits.eliminated(swap) for swap in swaps]
            best = self.fits.lowest(eliminated, default=fit)
            if self.fits.ebic(best) > self.fits.ebic(fit) - _SWAP_GAIN:
                break
            fit = self.fits.eliminated(self.fits.with_best_forms(best))
        return fit

    def swapped_in_pairs(self, fit: Fit) -> Fit:
        """`fit` with two effects replaced at once, while that lowers EBIC by 2.

        Where the mimics of two effects make up for each other's errors, replacing only one of
        them raises EBIC.
        """
        for _ in range(_MOST_SWAPS):
            singles = self._swaps(fit, fit.names, OUT_OF_REACH)
            halfway = [half for half in self._distinct([fit, *singles]) if half.names != fit.names]
            pairs = [
                swap
                for half in halfway
                for swap in self._swaps(half, half.names & fit.names, OUT_OF_REACH)
            ]
            best = self.fits.lowest(pairs, default=fit)
            if self.fits.ebic(best) > self.fits.ebic(fit) - _SWAP_GAIN:
                break
            fit = self._swapped(self.fits.eliminated(self.fits.with_best_forms(best)))
        return fit

    def _swaps(self, fit: Fit, names: frozenset[str], delta_ebic: float) -> list[Fit]:
        """Fits with one of `names` replaced, at an EBIC less than `delta_ebic` above `fit`.

        Names in order: fits share sets, and which start comes first must not vary.
        """
        swaps = [swap for name in sorted(names) for swap in self.alternatives.swaps(fit, name)]
        limit = self.fits.ebic(fit) + delta_ebic
        return [swap for swap in swaps if self.fits.ebic(swap) < limit]

    def _several_replaced(self, fit: Fit) -> Fit:
        """`fit`, or a single effect in the place of all of its effects or of all but one.

        Far from linear, the signature of one effect predicts less than several others add up to.
        """
        bases = [self.fits.null] if len(fit.candidates) > 1 else []
        if len(fit.candidates) > 2:
            bases += [self._only(fit, name) for name in sorted(fit.names)]
        limit = self.fits.rss_limit(fit, OUT_OF_REACH)
        fewer = [other for base in bases for other in self._substitutes(base, fit, limit)]
        in_best_forms = [self.fits.with_best_forms(other, limit) for other in self._distinct(fewer)]
        best = self.fits.lowest(in_best_forms, default=fit)
        return self._swapped(best) if self.fits.is_lower(best, fit) else fit

    def _only(self, fit: Fit, name: str) -> Fit:
        """The effect `name` of `fit` without the others."""
        for other in sorted(fit.names - {name}):
            fit = self.fits.without(fit, other)
        return fit

    def _substitutes(self, base: Fit, fit: Fit, limit: float) -> list[Fit]:
        """`base` with one effect predicted to gain at least half of what `fit` gains over it."""
        needed = _MOST_OF_GAIN * (base.rss - fit.rss)
        scores = [
            s
            for s in self.screening.scores(base, self.fits.null)
            if s.starts and s.predicted_reduction > needed and s.candidate.name not in fit.names
        ]
        return self.fits.each(
            lambda s: self.fits.with_added(base, s, limit), scores[:_MOST_SUBSTITUTES]
        )

    # -- tests of a fit ----------------------------------------------------------------

    def _is_noise(self, fit: Fit) -> bool:
        """True if the residual of `fit` passes the tests of noise."""
        return not examine(self.fits.residuals, fit.residual, len(fit.order)).significant

    def _complete(self, fit: Fit) -> bool:
        """True if the residual is noise and no candidate is predicted to lower EBIC."""
        if not self._is_noise(fit):
            return False
        scores = self.screening.scores(fit, self.fits.null)
        return all(self.screening.predicted_ebic(fit, s) >= self.fits.ebic(fit) for s in scores)

    def _distinct(self, fits: list[Fit]) -> list[Fit]:
        """The fits whose residuals differ by more than 10 in chi-squared, the lowest EBIC first."""
        chosen: list[Fit] = []
        for fit in self.fits.lowest_first(fits):
            distances = (float(np.sum((fit.residual - c.residual) ** 2)) for c in chosen)
            if all(distance > ALTERNATIVE_MARGIN * fit.noise_variance for distance in distances):
                chosen.append(fit)
        return chosen
