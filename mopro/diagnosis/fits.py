"""The fits of sets of effects, each done once, and what follows from one to the next."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Lock
from typing import TypeVar

import numpy as np

from mopro.diagnosis.fit import Fit, fit
from mopro.diagnosis.heldout import HeldOut, held_out
from mopro.diagnosis.model import Candidate, Settings
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.signature import Scored

# What an effect and a parameter cost that are not needed, in any but the largest data.
_ONE_TOO_MANY = 40.0

# By so much a start must be nearer than a known fit, in chi-squared, to be fitted from as well.
_NEARER = 1.0

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[str], None]
# A set of effects in their forms.
Key = frozenset[tuple[str, str]]
# A fit of such a set, told from a nearer one by its sum of squares.
Identity = tuple[Key, float]


class Fits:
    """Fits effects of `catalogue` to one problem; `jobs` simulations go on at once."""

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
        self._lock = Lock()
        # With the limit that each was fitted for.
        self._fits: dict[Key, tuple[Fit, float]] = {}
        self._begun: set[tuple[Identity, str]] = set()

    @property
    def null(self) -> Fit:
        return self.fitted((), [{}])

    def cost(self, found: Fit) -> float:
        return found.cost(len(self.catalogue))

    def fitted(
        self,
        candidates: Sequence[Candidate],
        starts: Sequence[Settings],
        limit: float = math.inf,
    ) -> Fit:
        """The fit of a set of effects; each set is fitted once.

        One that does not come near `limit` is given up; it is fitted anew for a wider one.
        """
        key = frozenset(candidate.key for candidate in candidates)
        with self._lock:
            known, reach = self._fits.get(key, (None, 0.0))
        if known is not None and (not known.hopeless or limit <= reach):
            return known
        if candidates:
            self.progress("fitting " + " + ".join(sorted(c.name for c in candidates)))
        found = fit(self.residuals, candidates, starts, limit)
        with self._lock:
            # Another thread may have been faster.
            known, reach = self._fits.get(key, (None, 0.0))
            if known is None or (known.hopeless and limit > reach):
                self._fits[key] = found, limit
            return self._fits[key][0]

    def joined(self, base: Fit, scored: Scored, limit: float = math.inf) -> Fit:
        """`base` with a candidate beside it; for `limit` see `fitted`."""
        starts = [{**base.settings, **start} for start in scored.starts]
        return self.fitted((*base.candidates, scored.candidate), starts, limit)

    def replaced(self, found: Fit, name: str, scored: Scored, limit: float) -> Fit:
        """`found` with a candidate in the place of `name`.

        A rival leaves the other effects much as they are: the fit starts there, from the
        nearer of the candidate's starts.
        """
        kept, settings = _others(found, name)
        starts = [{**settings, **start} for start in scored.starts]
        nearest = min(starts, key=lambda s: float(np.sum(self.residuals.at(s) ** 2)))
        return self.fitted((*kept, scored.candidate), [nearest], limit)

    def without(self, found: Fit, name: str, limit: float = math.inf) -> Fit:
        """`found` without the effect `name`; for `limit` see `fitted`.

        Where the slopes lead the others nearer than they were ever fitted, that was not their best
        fit, and it is begun anew there.
        """
        kept, settings = _others(found, name)
        fewer = self.fitted(kept, [settings], limit)
        if not kept or (found.identity, name) in self._begun:
            return fewer
        self._begun.add((found.identity, name))
        led = found.others_without(name)
        if float(np.sum(self.residuals.at(led) ** 2)) > fewer.rss - _NEARER * found.variance:
            return fewer
        return self._begun_anew(kept, led, limit)

    def _begun_anew(self, candidates: Sequence[Candidate], start: Settings, limit: float) -> Fit:
        """The fit from `start`, in the place of one that is not as near."""
        found = fit(self.residuals, candidates, [start], limit)
        with self._lock:
            self._fits[found.key] = found, limit
        return found

    def stripped(self, found: Fit, name: str) -> Fit:
        """`found` without the effect `name`, the others left as they are."""
        rest = self.without(found, name)
        _, settings = _others(found, name)
        return replace(rest, settings=settings, residual=self.residuals.at(settings))

    def no_dearer(self, found: Fit, by: float = 0.0) -> float:
        """The sum of squares above which no fit costs less than `found` does, and `by` more."""
        return found.rss_of(self.cost(found) + by)

    def refined(self, found: Fit, limit: float = math.inf) -> Fit:
        """`found` with its effects freed further, or less far, as long as that pays.

        An effect that has been freed may make another one superfluous.
        """
        limit = min(limit, self.no_dearer(found, _ONE_TOO_MANY))
        trials = [
            self._in_another_form(found, form, limit)
            for candidate in found.candidates
            for form in self._forms_beside(candidate)
        ]
        close = [t for t in trials if self.cost(t) < self.cost(found) + _ONE_TOO_MANY]
        best = min(map(self.pruned, close), key=self.cost, default=found)
        return self.refined(best, limit) if self.cost(best) < self.cost(found) else found

    def _in_another_form(self, found: Fit, form: Candidate, limit: float) -> Fit:
        kept = [c for c in found.candidates if c.name != form.name]
        values = {p.name: p.null for p in form.parameters}
        start = {**values, **{p.name: p.starts[0] for p in form.parameters if p.starts}}
        own = {n: v for n, v in found.settings[form.name].items() if n in start}
        joined = form.settings(start | own)
        return self.fitted((*kept, form), [{**found.settings, **joined}], limit)

    def _forms_beside(self, candidate: Candidate) -> list[Candidate]:
        """The forms that free more of an effect, and those that free less of a freed one."""
        return [
            form
            for form in self.catalogue
            if (form.name, form.refines) == candidate.key
            or (candidate.refines is not None and (form.frees_more_than(candidate)
                                                   or candidate.frees_more_than(form)))
        ]  # fmt: skip

    def pruned(self, found: Fit, least: float = 0.0) -> Fit:
        """`found` without the effects that do not pay for themselves, by `least` at least."""
        while found.candidates:
            limit = self.no_dearer(found, least)
            fewer = [self.without(found, name, limit) for name in sorted(found.names)]
            cheaper = min(fewer, key=self.cost)
            if self.cost(cheaper) > self.cost(found) + least:
                break
            found = cheaper
        return found

    def held_out(self, found: Fit) -> HeldOut | None:
        """How parts that were not fitted are predicted, with and without each effect."""
        without = {name: self.without(found, name) for name in found.names}
        return held_out(self.residuals, self.null, found, without)

    def each(self, function: Callable[[T], R], items: Iterable[T]) -> list[R]:
        """`function` of all items, in several threads if there is more than one job."""
        if self.jobs == 1:
            return [function(item) for item in items]
        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(function, items))


def _others(found: Fit, name: str) -> tuple[tuple[Candidate, ...], Settings]:
    """The effects of `found` but for `name`, and what they were found at."""
    kept = tuple(c for c in found.candidates if c.name != name)
    return kept, {c.name: found.settings[c.name] for c in kept}
