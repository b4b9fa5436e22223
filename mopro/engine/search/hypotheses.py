"""Hypotheses: fitted sets of effects, and the evidence by which all of them are judged."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import product
from typing import TypeVar

import numpy as np

from mopro.engine.assumed import (
    ITERATIONS,
    LEAST_SHARE,
    OUT_OF_REACH,
    PROPORTIONAL,
    SAME,
    VERY_STRONG,
)
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.fits import (
    NO_LIMIT,
    Evidence,
    Fit,
    HeldOut,
    Identity,
    Key,
    Limit,
    growing_fit,
    held_out,
    least_squares_fit,
)
from mopro.engine.residuals import (
    Noise,
    Remainder,
    Residuals,
    as_noise,
    difference_variance,
    examine,
    noise_of,
)
from mopro.engine.series import Settings, Simulate
from mopro.engine.threads import in_threads

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[str], None]
# A set of effects in their forms, and settings that its fit may start from.
Proposal = tuple[Sequence[Candidate], Sequence[Settings]]


class Hypotheses:
    """Sets of effects of `catalogue`, fitted to one problem together with the model's `base`.

    A set is fitted once, from the start that it was first proposed with, and again from any
    later one that begins lower. `evidence` judges all sets by the same noise; `white`, by
    white noise, predicts which of them are worth a fit. `jobs` fits run at once. `runs_on`: the
    model may get out of phase with the data, and is fitted with `base` from their beginning on.
    """

    def __init__(
        self,
        residuals: Residuals,
        catalogue: Sequence[Candidate],
        base: Sequence[Candidate] = (),
        jobs: int = 1,
        progress: Progress = lambda _: None,
        runs_on: bool = True,
    ) -> None:
        self.catalogue = tuple(catalogue)
        self.base = tuple(base)
        self.progress = progress
        self.jobs = jobs
        self._grows = runs_on and bool(base)
        self._keys = [candidate.key for candidate in catalogue]
        self.white = self.evidence = Evidence(Noise.as_stated(residuals), self._keys)
        self._fits: dict[Key, Fit] = {}
        self._limits: dict[Key, Limit] = {}
        self._judged_by: Identity | None = None
        self._stepped: set[tuple[Identity, str]] = set()
        self._remainders: dict[Identity, Remainder] = {}
        self.residuals = residuals
        self._fit_null()
        if base and not residuals.known_noise:
            self.residuals = residuals.scaled_at(self.null.settings)
            self._fit_null()
        if not all(series.exact for series in residuals.data):
            self.residuals = self.residuals.calibrated_at(self.null.settings)
            self._fit_null()

    @property
    def null(self) -> Fit:
        """The model without any effect."""
        return self._fits[frozenset()]

    def _fit_null(self) -> None:
        """The model without any effect, its base fitted from each combination of its starts."""
        ranges = [[(c.name, p.name, v) for v in p.starts] for c in self.base for p in c.parameters]
        starts: list[Settings] = [
            {c.name: {name: v for of, name, v in values if of == c.name} for c in self.base}
            for values in product(*ranges)
        ]
        fits = [least_squares_fit(self.residuals, (), starts, NO_LIMIT, self.base)]
        if self._grows:
            fits.append(self._from((), self._lowest(starts), NO_LIMIT))
        fit = min(fits, key=lambda f: f.rss)
        if not np.isfinite(self.residuals.predicted(fit.settings)).all():
            raise ValueError("the model without effects predicts values that are not finite")
        self._fits[fit.key] = fit

    def copy(self) -> Hypotheses:
        """These sets, to which others may be fitted without changing these."""
        own = copy(self)
        own._fits, own._limits = dict(self._fits), dict(self._limits)
        own._stepped, own._remainders = set(self._stepped), dict(self._remainders)
        return own

    def join(self, laws: Sequence[Candidate], simulate: Simulate, coarse: Simulate | None) -> None:
        """Let free-form terms compete, which `simulate` and `coarse` know beside the catalogue."""
        self.catalogue = (*self.catalogue, *laws)
        self.residuals = self.residuals.of_model(simulate, coarse)

    def leave_out(self, names: Collection[str]) -> None:
        """Let candidates of these names compete no more."""
        self.catalogue = tuple(c for c in self.catalogue if c.name not in names)

    # -- judging ------------------------------------------------------------------------

    def ebic(self, fit: Fit) -> float:
        return self.evidence.ebic(fit)

    def best(self) -> Fit:
        """The set of the lowest EBIC."""
        return self.evidence.lowest(self._complete())

    def best_listed(self) -> Fit:
        """The set of the lowest EBIC without free-form terms."""
        return self.evidence.lowest([fit for fit in self._complete() if not fit.laws])

    def ranked(self) -> list[Fit]:
        """All sets that were fitted to their minimum, the lowest EBIC first."""
        return sorted(self._complete(), key=lambda fit: (self.ebic(fit), self.evidence.place(fit)))

    def as_good(self, best: Fit) -> list[Key]:
        """Keys of the best set, and of those that do as well if it leaves noise: within 10 in EBIC.

        What may join one of these is weak, and is found beside the best one: they leave the same.
        """
        if not self.is_noise(best):
            return [best.key]
        limit, count = self.ebic(best) + VERY_STRONG, len(best.candidates)
        near = (fit for fit in self.ranked() if self.ebic(fit) < limit)
        return [fit.key for fit in near if len(fit.candidates) >= count]

    def _complete(self) -> list[Fit]:
        return [fit for fit in self._fits.values() if not fit.abandoned]

    def fullest(self) -> Fit:
        """The set that leaves the smallest sum of squares."""
        return min(self._complete(), key=lambda fit: (fit.rss, sorted(fit.key)))

    def is_noise(self, fit: Fit) -> bool:
        """True if the residual of `fit` tests as white noise, of the stated size or larger."""
        remainder = self._remainder(fit)
        return not remainder.significant or remainder.only_size

    def leaves_noise(self, fit: Fit) -> bool:
        """True if what `fit` leaves may be noise, of whatever size and memory."""
        remainder = self._remainder(fit)
        return not remainder.significant or bool(
            as_noise(self.residuals, self.evidence.noise, fit.residual, remainder)
        )

    def _remainder(self, fit: Fit) -> Remainder:
        """What `fit` leaves, examined once: the tests take longer than a simulation."""
        if fit.identity not in self._remainders:
            self._remainders[fit.identity] = examine(self.residuals, fit.residual, len(fit.order))
        return self._remainders[fit.identity]

    def judge_by(self, fit: Fit) -> None:
        """Judge by noise like the remainder of `fit`, unless that is as stated."""
        if fit.identity == self._judged_by:
            return
        self._judged_by = fit.identity
        self.evidence = self.evidence_by(fit)
        noise = self.evidence.noise
        white = noise if noise.exact else Noise.as_stated(self.residuals)
        self.white = Evidence(white, self._keys)

    def evidence_by(self, fit: Fit) -> Evidence:
        """Evidence by noise like the remainder of `fit`, unless that is as stated."""
        return Evidence(noise_of(self.residuals, fit.residual, len(fit.order)), self._keys)

    # -- fitting ------------------------------------------------------------------------

    def fit_all(
        self,
        proposals: Sequence[Proposal],
        limit: Limit | Callable[[Sequence[Candidate]], Limit] = NO_LIMIT,
    ) -> list[Fit]:
        """The fits of several sets, each from the lowest of its own starts; see `fitted`.

        `limit` is that of all of them, or tells that of a set. Each is fitted as if it were the
        only one, so that neither their order nor the number of jobs matters.
        """
        known = dict(self._fits)
        limits = [limit if isinstance(limit, Limit) else limit(own) for own, _ in proposals]

        def fitted(each: tuple[Proposal, Limit]) -> Fit:
            (candidates, starts), own = each
            return self._fit(candidates, self._lowest(starts), own, known)

        fits = self.each(fitted, zip(proposals, limits, strict=True))
        return [self._kept(fit, own) for fit, own in zip(fits, limits, strict=True)]

    def fit_again(self, others: Hypotheses) -> None:
        """Fit the sets that were fitted to other data, each from where it ended there."""
        self.fit_all([(fit.candidates, [fit.settings]) for fit in others.ranked()])
        self.judge_by(self.fullest())

    def knows(self, candidates: Sequence[Candidate], ebic: float) -> bool:
        """True if the set is fitted, and no more than `OUT_OF_REACH` above the predicted `ebic`."""
        known = self._fits.get(frozenset(candidate.key for candidate in candidates))
        if known is None or known.abandoned:
            return False
        return self.white.ebic(known) < ebic + OUT_OF_REACH

    def _lowest(self, starts: Sequence[Settings]) -> Settings:
        """The start that leaves the smallest sum of squares."""
        if len(starts) == 1:
            return starts[0]
        return min(starts, key=lambda s: float(np.sum(self.residuals.at(s) ** 2)))

    def fitted(
        self, candidates: Sequence[Candidate], start: Settings, limit: Limit = NO_LIMIT
    ) -> Fit:
        """The fit of a set of effects; one that cannot come down to `limit` is abandoned.

        An abandoned set is fitted again for another limit that is no closer.
        """
        return self._kept(self._fit(candidates, start, limit, self._fits), limit)

    def fitted_from(self, candidates: Sequence[Candidate], start: Settings, limit: Limit) -> Fit:
        """As `fitted`, also from a start that leaves more than what is known of the set."""
        return self._kept(self._from(candidates, start, limit), limit)

    def _fit(
        self,
        candidates: Sequence[Candidate],
        start: Settings,
        limit: Limit,
        fits: Mapping[Key, Fit],
    ) -> Fit:
        """As `fitted`, where `fits` are known; they are not changed."""
        key = frozenset(candidate.key for candidate in candidates)
        known = fits.get(key)
        if known is not None and known.abandoned and self._limits[key].includes(limit):
            return known
        if known is not None and not known.abandoned and not self._begins_lower(start, known):
            return known
        self.progress("fitting " + " + ".join(sorted(c.name for c in candidates)))
        fit = self._from(candidates, start, limit)
        smaller = _lower_subset(fit, fits)
        if smaller is None:
            return fit
        faint = {**_faint(candidates, start), **smaller.settings}
        again = least_squares_fit(self.residuals, candidates, [faint], limit, self.base)
        return min(fit, again, key=lambda f: f.rss)

    def _from(self, candidates: Sequence[Candidate], start: Settings, limit: Limit) -> Fit:
        """The fit from `start`; where it leaves much of a model that may run on, a growing one.

        Of the two the lower one is taken.
        """
        fit = least_squares_fit(self.residuals, candidates, [start], limit, self.base)
        if (weaker := self._off_plateau(fit)) is not None:
            again = least_squares_fit(self.residuals, candidates, [weaker], limit, self.base)
            fit = min(fit, again, key=lambda f: f.rss)
        if not self._grows or not fit.far_from_linear:
            return fit
        grown = growing_fit(self.residuals, candidates, start, limit, self.base)
        return min(fit, grown, key=lambda f: f.rss)

    def _off_plateau(self, fit: Fit) -> Settings | None:
        """A third of the size of a single effect, where that hardly matters: None if it does.

        From beyond the size at which an effect saturates, no slope leads back.
        """
        sizes = [(name, p) for name, p in fit.order if p.role is Role.AMPLITUDE]
        if len(fit.candidates) != 1 or self.base or len(sizes) != 1:
            return None
        ((name, p),) = sizes
        value, in_proportion = fit.settings[name][p.name], fit.linear_part(name)
        change = fit.residual - self.null.residual
        if PROPORTIONAL**2 * float(in_proportion @ in_proportion) > float(change @ change):
            return None
        weaker = p.within(p.multiplied(value, 1 / PROPORTIONAL))
        return {**fit.settings, name: {**fit.settings[name], p.name: weaker}}

    def _kept(self, fit: Fit, limit: Limit) -> Fit:
        """`fit`, or the one that is known of its set and no worse."""
        known = self._fits.get(fit.key)
        if fit is known:
            return fit
        if known is None or known.abandoned or fit.rss < known.rss:
            self._fits[fit.key], self._limits[fit.key] = fit, limit
        return self._fits[fit.key]

    def settled(self, fit: Fit) -> Fit:
        """`fit` refitted from its own end until it stands still, as a narrow valley may need.

        Its Jacobian is taken anew there. With free numbers in a model that may run on, it is also
        refitted from the beginning of the data onwards.
        """
        if self._grows:
            grown = growing_fit(self.residuals, fit.candidates, fit.settings, NO_LIMIT, self.base)
            fit = self._kept(grown, NO_LIMIT)
        for _ in range(ITERATIONS):
            again = least_squares_fit(
                self.residuals, fit.candidates, [fit.settings], base=self.base
            )
            stands = again.rss > fit.rss - SAME * self.scale(fit)
            if again.rss <= fit.rss:
                self._fits[fit.key] = fit = again
            if stands:
                break
        return fit

    def _begins_lower(self, start: Settings, known: Fit) -> bool:
        if not known.candidates or start == known.settings:
            return False
        rss = float(np.sum(self.residuals.at(start) ** 2))
        return rss < known.rss - SAME * self.scale(known)

    def without(self, fit: Fit, name: str, limit: Limit = NO_LIMIT) -> Fit:
        """`fit` without the effect `name`, from where a Gauss-Newton step leads, or as it stands.

        Of the two starts the lower one is taken.
        """
        others = [c for c in fit.candidates if c.name != name]
        if not others:
            return self.null
        known = self._fits.get(frozenset(c.key for c in others))
        once = (fit.identity, name)
        if known is not None and not known.abandoned and once in self._stepped:
            return known
        self._stepped.add(once)
        starts = [fit.stepped_without(name), fit.settings_without(frozenset({name}))]
        return self.fitted(others, self._lowest(starts), limit)

    def beside_single_runs(self, fit: Fit, drafted: Fit) -> Fit:
        """`fit` beside those free-form terms of `drafted` that are of one run alone.

        What is in one run is none of the machine: the effects of all runs have the sizes that they
        have beside it.
        """
        own = [c for c in drafted.candidates if c.law and c.law.run is not None]
        if not own:
            return fit
        return self.fitted((*fit.candidates, *own), {**fit.settings, **drafted.settings})

    def held_out(self, fit: Fit) -> HeldOut | None:
        """Prediction of held-out parts with and without each effect of `fit`.

        None without any, but where free numbers alone may make up for what is unexplained.
        """
        if not fit.candidates and (not fit.order or self.leaves_noise(fit)):
            return None
        without = {name: self.without(fit, name) for name in sorted(fit.names)}
        return held_out(self.residuals, self.evidence.noise, self.null, fit, without)

    def switched_off(self, fit: Fit, names: frozenset[str]) -> Fit:
        """`fit` with the effects `names` off and the others left as they are: no minimum."""
        kept = tuple(c for c in fit.candidates if c.name not in names)
        own = [i for i, (effect, _) in enumerate(fit.order) if effect not in names]
        settings = fit.settings_without(names)
        return replace(
            fit, candidates=kept, order=tuple(fit.order[i] for i in own), settings=settings,
            jacobian=fit.jacobian[:, own], residual=self.residuals.at(settings),
        )  # fmt: skip

    def noise_rss(self, fit: Fit) -> float:
        """Sum of squares of the noise; one not stated is what differs between neighbours."""
        if self.residuals.known_noise:
            return float(fit.count)
        parts = self.residuals.split(fit.residual)
        return sum(len(own) * difference_variance(own) for own in parts)

    def scale(self, fit: Fit) -> float:
        """Variance of the noise in units of the stated one, by the evidence's noise."""
        return float(np.mean(self.evidence.noise.variances(fit.residual)))

    def limit(self, fit: Fit) -> Limit:
        """Sum of squares above which any set is out of reach of the EBIC of `fit`."""
        noise, more = self.evidence.noise, self.evidence.penalty(fit) + OUT_OF_REACH
        if noise.exact and all(noise.stated):
            return Limit(fit.rss + more)
        if noise.exact:
            return Limit(fit.rss * math.exp(more / sum(noise.counts)))
        # Where the noise is strongest, an excess counts least.
        strongest = max(float(density.max()) for *_, density in noise.bands)
        return Limit(max(fit.rss + more * strongest, 2 * fit.rss))

    def each(self, function: Callable[[T], R], items: Iterable[T]) -> list[R]:
        """`function` of all items, in several threads if there is more than one job."""
        return list(in_threads(function, items, self.jobs))


def _lower_subset(fit: Fit, fits: Mapping[Key, Fit]) -> Fit | None:
    """A part of the set that leaves less by itself, as the fit ended in a local minimum."""
    if fit.abandoned:
        return None
    parts = (f for f in fits.values() if not f.abandoned and f.key < fit.key and f.rss < fit.rss)
    return min(parts, key=lambda f: f.rss, default=None)


def _faint(candidates: Sequence[Candidate], start: Settings) -> Settings:
    """The settings `start`, with each of the effects hardly there."""
    return {
        c.name: {
            **start[c.name],
            **{p.name: _faint_value(p) for p in c.parameters if p.role is Role.AMPLITUDE},
        }
        for c in candidates
    }


def _faint_value(parameter: Parameter) -> float:
    size = parameter.starts[0] if parameter.starts else parameter.value(0.5)
    return parameter.within(parameter.multiplied(size, LEAST_SHARE**2))
