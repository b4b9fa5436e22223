"""Effects that do as well as another in its place."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fits import Fits, Identity
from mopro.diagnosis.model import Settings
from mopro.diagnosis.promise import MISJUDGED, RIVAL_MARGIN, Promises
from mopro.diagnosis.signature import Scored

_TRIED = 5
# The most that a signature is taken to misjudge a gain by, as a share of it.
_MOST_MISJUDGED = 0.1
# One that promises less by no more than this share of a gain is looked at where it would stand.
_WORTH_A_LOOK = 0.2
# What is no stronger than 20 standard deviations in all is small, and so linear.
_WEAK = 400.0
_CLEARLY = 2.0
# Others that leave no more than this share, once an effect is gone, hide what it was from a search.
_MADE_UP_FOR = 0.8
# A rival whose misfit is larger by more cannot be as good, whatever parameters cost.
OUT_OF_REACH = 100.0


@dataclass(frozen=True)
class Rival:
    """An effect that does as well as another: how much dearer, and with all settings."""

    name: str
    dearer: float
    settings: Settings


def _dearer(rival: Rival) -> float:
    return rival.dearer


class Rivals:
    """Looks for what may take the place of an effect that was found."""

    def __init__(self, fits: Fits, promises: Promises) -> None:
        self._fits = fits
        self._promises = promises
        self._places: dict[tuple[Identity, str], tuple[Fit, list[Scored]]] = {}

    def of(self, found: Fit, name: str) -> list[Rival]:
        """Effects that do as well in the place of `name`, the cheapest first.

        Those of a weak effect are many, and most bend little: where one does as well at the size
        that its signature asks for, it is not fitted.
        """
        as_good: dict[str, Rival] = {}
        swaps = self.swaps(found, name)
        for swapped in swaps:
            fresh = [c for c in swapped.candidates if c.name not in found.names]
            # One that did not pay once it was freed is gone.
            if len(fresh) != 1:
                continue
            (rival,) = fresh
            worse = self._fits.cost(swapped) - self._fits.cost(found)
            as_well = worse < RIVAL_MARGIN and swapped.plausible
            # What a form was freed further for, it needs: that is no roominess.
            needed = rival.refines and not rival.by_itself
            if as_well and (needed or not _contains(swapped, found)):
                other = Rival(rival.name, worse, swapped.settings)
                as_good[rival.name] = min(other, as_good.get(rival.name, other), key=_dearer)
        fitted = {candidate.key for swap in swaps for candidate in swap.candidates}
        rest, scored = self._in_place_of(found, name)
        hopeful = [
            s
            for s in scored
            if s.candidate.name != name and s.candidate.key not in fitted and _plausible(s)
            and self._promises.predicted(rest, s) - self._fits.cost(found) < RIVAL_MARGIN
        ]  # fmt: skip
        weak = hopeful if rest.rss - found.rss < _WEAK else []
        for promised in self._fits.each(lambda s: self._weak(found, name, s), weak):
            if promised:
                as_good.setdefault(promised.name, promised)
        return sorted(as_good.values(), key=_dearer)

    def swaps(self, found: Fit, name: str) -> list[Fit]:
        """Fits with the likeliest rivals in the place of `name`."""
        rest, scored = self._in_place_of(found, name)
        gain = rest.rss - found.rss
        # Where signatures bend, they promise the effect itself less than it gains.
        promised = max((s.gain for s in scored if s.candidate.name == name), default=gain)
        misjudged = min(_MOST_MISJUDGED, MISJUDGED + 2 * abs(promised / gain - 1))
        enough = min(gain, promised) - 4 * RIVAL_MARGIN - misjudged * gain
        if gain < _WEAK:
            enough = min(gain, promised)
        likely = [
            s
            for s in scored
            if s.candidate.name != name and s.starts and s.gain > enough - _WORTH_A_LOOK * gain
        ]
        seen = self._fits.each(
            lambda s: s if s.gain > enough else self._promises.closer(rest, s), likely
        )
        close = sorted((s for s in seen if s.gain > enough), key=lambda s: -s.gain)
        limit = _reach(found)
        joined = self._fits.each(
            lambda s: self._fits.replaced(found, name, s, limit), close[:_TRIED]
        )
        return [*joined, *self._fits.each(lambda fit: self._fits.refined(fit, limit), joined)]

    def _weak(self, found: Fit, name: str, scored: Scored) -> Rival | None:
        """The rival that a signature promises in the place of `name`, if it is one."""
        rest = self._fits.without(found, name)
        settings: Settings = {**rest.settings, **scored.starts[0]}
        left = float(np.sum(self._fits.residuals.at(settings) ** 2))
        shown = replace(scored, gain=rest.rss - left)
        worse = self._promises.predicted(rest, shown) - self._fits.cost(found)
        if worse >= RIVAL_MARGIN:
            swapped = self._fits.replaced(found, name, scored, _reach(found))
            settings = swapped.settings
            worse = self._fits.cost(swapped) - self._fits.cost(found)
            if worse >= RIVAL_MARGIN or not swapped.plausible:
                return None
        return Rival(scored.candidate.name, worse, settings)

    def _in_place_of(self, found: Fit, name: str) -> tuple[Fit, list[Scored]]:
        """`found` without `name`, and what promises to take its place."""
        key = found.identity, name
        if key not in self._places:
            rest = self._fits.without(found, name)
            anew = self._promises.taken_at(rest)
            scored = self._promises.scores(rest, rest if anew else self._fits.null)
            unmoved = self._fits.stripped(found, name)
            if rest.rss < _MADE_UP_FOR * unmoved.rss:
                scored = self._promises.sought_in(unmoved, rest, scored)
            self._places[key] = rest, scored
        return self._places[key]


def _reach(found: Fit) -> float:
    """The sum of squares from which on no rival of `found` is as good."""
    return found.rss + OUT_OF_REACH * found.variance


def _plausible(scored: Scored) -> bool:
    """Whether the size that the signature asks for is one to expect, errors allowed for."""
    if not scored.starts:
        return False
    values = scored.starts[0][scored.candidate.name]
    known = _CLEARLY / math.sqrt(max(scored.gain, 1.0))
    return not any(
        p.beyond(values[p.name]) > known * abs(values[p.name]) for p in scored.candidate.parameters
    )


def _contains(wider: Fit, found: Fit) -> bool:
    """Whether `wider` has more parameters and comes down to the same prediction.

    Then it is no other explanation, only a roomier one.
    """
    extra = len(wider.order) + wider.held - len(found.order) - found.held
    if extra <= 0:
        return False
    apart = wider.residual - found.residual
    scale = 1.0 if found.known_noise else found.rss / found.count
    return float(apart @ apart) / scale < float(stats.chi2.ppf(0.999, extra))
