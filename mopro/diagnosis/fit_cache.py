"""Fits of sets of effects, each done once, and the moves from one set to the next."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Lock
from typing import TypeVar

import numpy as np

from mopro.diagnosis.fit import Fit, least_squares_fit
from mopro.diagnosis.heldout import HeldOut, held_out
from mopro.diagnosis.model import Candidate, Settings
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.signature import ScoreTest
from mopro.diagnosis.ties import TIE, lowest_first

# EBIC by which another form may at first be worse, as it may make an effect superfluous: that
# saves its penalty, a parameter's and a choice's, in any but the largest data. Halved, some forms
# are never looked at beside the effect that they replace; doubled, more fits are run to their end.
_ONE_EFFECT = 40.0

# Chi-squared by which a start must be below a known fit of the same set to be fitted from too.
# Below it the two are the same minimum.
_BETTER_START = 1.0

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[str], None]
# A set of effects in their forms.
Key = frozenset[tuple[str, str]]
# A fit of such a set, told from a better one by its sum of squares.
Identity = tuple[Key, float]


class FitCache:
    """Fits sets of effects of `catalogue` to one problem; `jobs` fits run at once.

    A set is fitted once, from the starts that come first.
    """

    def __init__(
        self,
        residuals: Residuals,
        catalogue: Sequence[Candidate],
        jobs: int = 1,
        progress: Progress = lambda _: None,
    ) -> None:
        self.residuals = residuals
        self.catalogue = tuple(catalogue)
        self.progress = progress
        self.jobs = jobs
        self._places = {c.key: place for place, c in enumerate(self.catalogue)}
        self._lock = Lock()
        # Each with the limit that it was fitted for.
        self._fits: dict[Key, tuple[Fit, float]] = {}
        self._restarted: set[tuple[Identity, str]] = set()

    @property
    def null(self) -> Fit:
        """The model as it is, without any effect."""
        return self.fitted((), [{}])

    def ebic(self, fit: Fit) -> float:
        """Extended BIC of `fit` with this catalogue; lower is better."""
        return fit.ebic(len(self.catalogue))

    def place(self, candidate: Candidate) -> int:
        """Place of `candidate` in the catalogue."""
        return self._places[candidate.key]

    def lowest_first(self, fits: Iterable[Fit]) -> list[Fit]:
        """`fits`, the lowest EBIC first; a tie goes by the places in the catalogue."""
        return lowest_first(fits, self.ebic, lambda fit: sorted(map(self.place, fit.candidates)))

    def lowest(self, fits: Iterable[Fit], default: Fit) -> Fit:
        """The first of `lowest_first`; `default` if there are no fits."""
        return next(iter(self.lowest_first(fits)), default)

    def is_lower(self, fit: Fit, other: Fit) -> bool:
        """True if the EBIC of `fit` is below that of `other` by more than a tie."""
        return self.ebic(fit) < self.ebic(other) - TIE

    def fitted(
        self,
        candidates: Sequence[Candidate],
        starts: Sequence[Settings],
        rss_limit: float = math.inf,
    ) -> Fit:
        """The fit of a set of effects; each set is fitted once.

        One that cannot come down to `rss_limit` is abandoned, and fitted again for a wider
        limit.
        """
        key = frozenset(candidate.key for candidate in candidates)
        with self._lock:
            known, known_limit = self._fits.get(key, (None, 0.0))
        if known is not None and (not known.abandoned or rss_limit <= known_limit):
            return known
        if candidates:
            self.progress("fitting " + " + ".join(sorted(c.name for c in candidates)))
        fit = least_squares_fit(self.residuals, candidates, starts, rss_limit)
        with self._lock:
            # Another thread may have been faster.
            known, known_limit = self._fits.get(key, (None, 0.0))
            if known is None or (known.abandoned and rss_limit > known_limit):
                self._fits[key] = fit, rss_limit
            return self._fits[key][0]

    def with_added(self, base: Fit, score: ScoreTest, rss_limit: float = math.inf) -> Fit:
        """`base` with a candidate added; for `rss_limit` see `fitted`."""
        starts = [{**base.settings, **start} for start in score.starts]
        return self.fitted((*base.candidates, score.candidate), starts, rss_limit)

    def with_replaced(self, fit: Fit, name: str, score: ScoreTest, rss_limit: float) -> Fit:
        """`fit` with a candidate in the place of the effect `name`.

        An alternative leaves the other effects much as they are: the fit starts there, from
        the start of the candidate that leaves the smaller sum of squares.
        """
        others, settings = _others(fit, name)
        starts = [{**settings, **start} for start in score.starts]
        nearest = min(starts, key=lambda s: float(np.sum(self.residuals.at(s) ** 2)))
        return self.fitted((*others, score.candidate), [nearest], rss_limit)

    def without(self, fit: Fit, name: str, rss_limit: float = math.inf) -> Fit:
        """`fit` without the effect `name`; for `rss_limit` see `fitted`.

        Where a Gauss-Newton step from `fit` comes lower than the others were ever fitted, that
        was a local minimum, and they are fitted again from there.
        """
        others, settings = _others(fit, name)
        reduced = self.fitted(others, [settings], rss_limit)
        if not others or (fit.identity, name) in self._restarted:
            return reduced
        self._restarted.add((fit.identity, name))
        start = fit.others_without(name)
        start_rss = float(np.sum(self.residuals.at(start) ** 2))
        if start_rss > reduced.rss - _BETTER_START * fit.noise_variance:
            return reduced
        return self._refitted(others, start, rss_limit)

    def _refitted(self, candidates: Sequence[Candidate], start: Settings, rss_limit: float) -> Fit:
        """The fit from `start`, in the place of the one that was in the cache."""
        fit = least_squares_fit(self.residuals, candidates, [start], rss_limit)
        with self._lock:
            self._fits[fit.key] = fit, rss_limit
        return fit

    def switched_off(self, fit: Fit, name: str) -> Fit:
        """`fit` without the effect `name`, the others left as they are."""
        reduced = self.without(fit, name)
        _, settings = _others(fit, name)
        return replace(reduced, settings=settings, residual=self.residuals.at(settings))

    def rss_limit(self, fit: Fit, delta_ebic: float = 0.0) -> float:
        """Sum of squares above which no fit has an EBIC below that of `fit` plus `delta_ebic`."""
        return fit.rss_of(self.ebic(fit) + delta_ebic)

    def with_best_forms(self, fit: Fit, rss_limit: float = math.inf) -> Fit:
        """`fit` with its effects in forms of more or fewer free parameters, while EBIC falls.

        A form with more may make another effect superfluous, which is then dropped.
        """
        rss_limit = min(rss_limit, self.rss_limit(fit, _ONE_EFFECT))
        trials = [
            self._in_another_form(fit, form, rss_limit)
            for candidate in fit.candidates
            for form in self._neighbouring_forms(candidate)
        ]
        close = [t for t in trials if self.ebic(t) < self.ebic(fit) + _ONE_EFFECT]
        best = self.lowest(map(self.eliminated, close), default=fit)
        return self.with_best_forms(best, rss_limit) if self.is_lower(best, fit) else fit

    def _in_another_form(self, fit: Fit, form: Candidate, rss_limit: float) -> Fit:
        others = [c for c in fit.candidates if c.name != form.name]
        values = {p.name: p.null for p in form.parameters}
        start = {**values, **{p.name: p.starts[0] for p in form.parameters if p.starts}}
        own = {n: v for n, v in fit.settings[form.name].items() if n in start}
        settings = form.settings(start | own)
        return self.fitted((*others, form), [{**fit.settings, **settings}], rss_limit)

    def _neighbouring_forms(self, candidate: Candidate) -> list[Candidate]:
        """The forms that extend a candidate, and those nested with one that extends another."""
        return [
            form
            for form in self.catalogue
            if (form.name, form.extends) == candidate.key
            or (candidate.extends is not None and (form.nests(candidate)
                                                   or candidate.nests(form)))
        ]  # fmt: skip

    def eliminated(self, fit: Fit, least_delta: float = 0.0) -> Fit:
        """Backward elimination: drop effects one by one while EBIC rises by `least_delta` at most.

        With 0 that is until EBIC would rise.
        """
        while fit.candidates:
            rss_limit = self.rss_limit(fit, least_delta)
            reduced = [self.without(fit, name, rss_limit) for name in sorted(fit.names)]
            best = self.lowest(reduced, default=fit)
            if self.ebic(best) > self.ebic(fit) + least_delta:
                break
            fit = best
        return fit

    def held_out(self, fit: Fit) -> HeldOut | None:
        """Prediction of parts that were not fitted, with and without each effect of `fit`."""
        without = {name: self.without(fit, name) for name in sorted(fit.names)}
        return held_out(self.residuals, self.null, fit, without)

    def each(self, function: Callable[[T], R], items: Iterable[T]) -> list[R]:
        """`function` of all items, in several threads if there is more than one job."""
        if self.jobs == 1:
            return [function(item) for item in items]
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(function, items))


def _others(fit: Fit, name: str) -> tuple[tuple[Candidate, ...], Settings]:
    """The effects of `fit` but for `name`, and their settings."""
    others = tuple(c for c in fit.candidates if c.name != name)
    return others, {c.name: fit.settings[c.name] for c in others}
