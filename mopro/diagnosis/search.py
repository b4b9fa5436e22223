"""Which effects, if any: a shortlist by score, a beam of fits forward, swaps, and back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy import stats

from mopro.diagnosis.fit import Fit, fit, price
from mopro.diagnosis.heldout import HeldOut, held_out
from mopro.diagnosis.model import Candidate, Role, Settings
from mopro.diagnosis.remainder import examine
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.signature import (
    Group,
    Scored,
    far_from_probes,
    probed_at,
    score,
    signatures,
    sought,
)
from mopro.diagnosis.sketch import Sketch, Sketcher, distinct

_SHORTLIST = 10
_FITTED_SETS = 3
_MOST_EFFECTS = 3
_MOST_STEPS = 4
_FORMS_OF_A_NAME = 2
_MOST_SWAPS = 3
_RIVALS_TRIED = 5
# A rival that is cheaper by less is as good, and may as well stay a rival.
_WORTH_A_SWAP = 2.0
# An effect that is no dearer than this (chi-squared and price) cannot be told apart.
RIVAL_MARGIN = 10.0
# How far a signature may misjudge what a fit will gain, as a share of that gain.
_MISJUDGED = 0.1
_LEAST_MISJUDGED = 0.005
# Where a signature promises this much, at a size far from the one that it was taken at,
# one is taken there.
_WORTH_ANOTHER_LOOK = 6.0
# What is no stronger than 20 standard deviations in all is small, and so linear.
_WEAK = 400.0
_CLEARLY = 2.0
# A rival whose misfit is larger by more cannot be as good, whatever parameters cost.
_OUT_OF_REACH = 100.0
# A residual this many times as large as noise may be too far off for signatures to rank.
_ROUGHLY = 100.0

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[str], None]
# A set of effects in their forms.
Key = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Rival:
    """An effect that does as well as another: how much dearer, and with all settings."""

    name: str
    dearer: float
    settings: Settings


def _dearer(rival: Rival) -> float:
    return rival.dearer


class Search:
    """Looks through a catalogue for the effects that account for a residual."""

    def __init__(
        self,
        residuals: Residuals,
        catalogue: Sequence[Candidate],
        jobs: int = 1,
        progress: Progress = lambda _: None,
    ) -> None:
        self.residuals = residuals
        self.catalogue = tuple(catalogue)
        self._jobs = jobs
        self._progress = progress
        self._fits: dict[Key, Fit] = {}
        self._scores: dict[tuple[Key, Key], list[Scored]] = {}
        self._groups: dict[tuple[Key, tuple[str, str]], list[Group]] = {}

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

        One that does not come near `limit` is given up; it is asked for anew without.
        """
        key = frozenset(candidate.key for candidate in candidates)
        known = self._fits.get(key)
        if known is None or (known.hopeless and limit == math.inf):
            if candidates:
                self._progress("fitting " + " + ".join(sorted(c.name for c in candidates)))
            self._fits[key] = fit(self.residuals, candidates, starts, limit)
        return self._fits[key]

    def _each(self, function: Callable[[T], R], items: Iterable[T]) -> list[R]:
        """`function` of all items, in several threads if there is more than one job."""
        if self._jobs == 1:
            return [function(item) for item in items]
        with ThreadPoolExecutor(self._jobs) as pool:
            return list(pool.map(function, items))

    # -- signatures ------------------------------------------------------------

    def scores(self, base: Fit, at: Fit | None = None) -> list[Scored]:
        """All candidates that may join `base`, the most promising first (score test).

        Signatures are those at `at`, which is `base` itself unless given: those at a fit
        nearby cost no simulation.
        """
        key = base.key, (at or base).key
        if key not in self._scores:
            self._scores[key] = self._scored(base, at or base)
        return self._scores[key]

    def _scored(self, base: Fit, at: Fit) -> list[Scored]:
        others = [c for c in self.catalogue if c.name not in base.names and c.refines is None]
        return self._weighed(base, at, others)

    def _fresh(self, base: Fit) -> list[Scored]:
        """As `scores`, signatures taken anew for those that those at the null speak for.

        Where the null is far off its signatures speak for nobody, and all are taken anew.
        """
        if base.key == self.null.key or self.null.rss > _ROUGHLY * self.null.count:
            return self.scores(base)
        known = self.scores(base, self.null)
        limit = self.cost(base) + RIVAL_MARGIN
        hopeful = [s.candidate for s in known if self.predicted(base, s) < limit]
        kept = [s for s in known if s.candidate not in hopeful]
        return [*self._weighed(base, base, hopeful), *kept]

    def _weighed(self, base: Fit, at: Fit, candidates: Sequence[Candidate]) -> list[Scored]:
        tangent, _ = np.linalg.qr(base.jacobian)

        def scored(candidate: Candidate) -> Scored:
            groups = self._signatures(at, candidate)
            groups = [*groups, *sought(self.residuals, base, candidate)]
            first = score(base, tangent, candidate, groups)
            if first.gain < _WORTH_ANOTHER_LOOK or not far_from_probes(first, groups):
                return first
            closer = probed_at(self.residuals, at, candidate, first.starts[0])
            return score(base, tangent, candidate, [*groups, closer])

        found = self._each(scored, candidates)
        return sorted(found, key=lambda s: self.predicted(base, s))

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
        key = (at.key, candidate.key)
        if key not in self._groups:
            self._progress(f"the signature of {candidate.name}")
            self._groups[key] = signatures(self.residuals, at, candidate)
        return self._groups[key]

    def predicted(self, base: Fit, scored: Scored) -> float:
        """The cost that `base` and a candidate together promise to come to."""
        left = max(base.rss - scored.gain, 1e-300)
        misfit = left if base.known_noise else base.count * math.log(left / max(base.count, 1))
        return self.cost(base) - base.misfit + misfit + self.dearer(base, scored.candidate)

    def dearer(self, base: Fit, candidate: Candidate) -> float:
        """What a candidate must gain in chi-squared beside `base` to pay for itself."""
        own = sum(price(parameter, base.count) for parameter in candidate.parameters)
        pool, count = len(self.catalogue), len(base.candidates)
        return own + 2 * (_log_ways(pool, count + 1) - _log_ways(pool, count))

    # -- steps -----------------------------------------------------------------

    def run(self) -> Fit:
        """The cheapest set of effects that steps forward, swaps and steps back lead to.

        Where signatures can be trusted whole sets are weighed by them, and the best are
        fitted; far from the data single effects are fitted instead.
        """
        found = self.null
        for _ in range(_MOST_STEPS):
            rough = found.rss > _ROUGHLY * found.count
            grown = self._extended(found) if rough else self._sketched(found)
            best = min([*grown, *map(self.refined, grown)], key=self.cost, default=found)
            best = self._pruned(best)
            if self.cost(best) >= self.cost(found):
                break
            found = best
            if self._settled(found):
                break
        return self._swapped(found)

    def _sketched(self, base: Fit) -> list[Fit]:
        """`base` with the sets of candidates whose signatures promise the most."""
        most = _MOST_EFFECTS - len(base.candidates)
        tangent, _ = np.linalg.qr(base.jacobian)
        sketches = Sketcher(base, tangent, self._fresh(base)).sets(
            most, lambda members: self._priced(base, members)
        )
        worth = [sketch for sketch in sketches if sketch.cost < self.cost(base)]
        return self._each(lambda sketch: self._drawn(base, sketch), distinct(worth, _FITTED_SETS))

    def _priced(self, base: Fit, members: Sequence[Scored]) -> float:
        """What `base` and `members` cost besides their misfit."""
        pool, count = len(self.catalogue), len(base.candidates)
        ways = _log_ways(pool, count + len(members)) - _log_ways(pool, count)
        own = sum(price(p, base.count) for m in members for p in m.candidate.parameters)
        return self.cost(base) - base.misfit + own + 2 * ways

    def _drawn(self, base: Fit, sketch: Sketch) -> Fit:
        candidates = [member.candidate for member in sketch.members]
        return self.fitted((*base.candidates, *candidates), [{**base.settings, **sketch.start}])

    def _settled(self, found: Fit) -> bool:
        """Whether nothing is left over that any candidate promises to account for."""
        if examine(self.residuals.data, found.residual, len(found.order)).significant:
            return False
        scored = self.scores(found, self.null)
        return all(self.predicted(found, s) >= self.cost(found) for s in scored)

    def _extended(self, base: Fit) -> list[Fit]:
        """`base` with each of the candidates that promise to pay for themselves.

        One stands for those that the data cannot tell from it; the others come as its rivals.
        """
        chosen: list[Scored] = []
        for s in self.scores(base) if len(base.candidates) < _MOST_EFFECTS else ():
            forms = sum(c.candidate.name == s.candidate.name for c in chosen)
            worth = s.starts and self.predicted(base, s) < self.cost(base)
            if worth and forms < _FORMS_OF_A_NAME and not any(s.twin_of(c) for c in chosen):
                chosen.append(s)
        return self._each(lambda s: self._joined(base, s), chosen[:_SHORTLIST])

    def _joined(self, base: Fit, scored: Scored, limit: float = math.inf) -> Fit:
        starts = [{**base.settings, **start} for start in scored.starts]
        return self.fitted((*base.candidates, scored.candidate), starts, limit)

    def refined(self, found: Fit, limit: float = math.inf) -> Fit:
        """`found` with its effects freed further, or less far, as long as that pays."""
        trials = [
            self._in_another_form(found, form, limit)
            for candidate in found.candidates
            for form in self._forms_beside(candidate)
        ]
        best = min(trials, key=self.cost, default=found)
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
        own = {p.name for p in candidate.parameters}
        return [
            form
            for form in self.catalogue
            if (form.name, form.refines) == candidate.key
            or (candidate.refines is not None and form.name == candidate.name
                and {p.name for p in form.parameters} < own)
        ]  # fmt: skip

    def _pruned(self, found: Fit) -> Fit:
        """`found` without the effects that do not pay for themselves."""
        while found.candidates:
            cheaper = min((self.without(found, name) for name in found.names), key=self.cost)
            if self.cost(cheaper) > self.cost(found):
                break
            found = cheaper
        return found

    def _swapped(self, found: Fit) -> Fit:
        """`found` with an effect replaced by a rival as long as that is better."""
        for _ in range(_MOST_SWAPS):
            swaps = [swap for name in found.names for swap in self._swaps(found, name)]
            better = min(swaps, key=self.cost, default=found)
            if self.cost(better) > self.cost(found) - _WORTH_A_SWAP:
                break
            found = self._pruned(self.refined(better))
        return found

    def without(self, found: Fit, name: str) -> Fit:
        kept = tuple(c for c in found.candidates if c.name != name)
        return self.fitted(kept, [{c.name: found.settings[c.name] for c in kept}])

    def _swaps(self, found: Fit, name: str) -> list[Fit]:
        """Fits with the likeliest rivals in the place of `name`."""
        rest, scored = self._in_place_of(found, name)
        gain = rest.rss - found.rss
        # Where signatures bend, they promise the effect itself less than it gains.
        promised = max((s.gain for s in scored if s.candidate.name == name), default=gain)
        misjudged = min(_MISJUDGED, _LEAST_MISJUDGED + 2 * abs(promised / gain - 1))
        enough = min(gain, promised) - 4 * RIVAL_MARGIN - misjudged * gain
        if gain < _WEAK:
            enough = min(gain, promised)
        close = [s for s in scored if s.candidate.name != name and s.starts and s.gain > enough]
        close.sort(key=lambda s: -s.gain)
        limit = found.rss + _OUT_OF_REACH * found.variance
        joined = self._each(lambda s: self._joined(rest, s, limit), close[:_RIVALS_TRIED])
        return [*joined, *self._each(lambda fit: self.refined(fit, limit), joined)]

    def _in_place_of(self, found: Fit, name: str) -> tuple[Fit, list[Scored]]:
        """`found` without `name`, and what promises to take its place."""
        rest = self.without(found, name)
        anew = (rest.key, rest.key) in self._scores
        return rest, self.scores(rest, rest if anew else self.null)

    def rivals(self, found: Fit, name: str) -> list[Rival]:
        """Effects that do as well in the place of `name`, the cheapest first.

        Those of a weak effect are judged by their signatures: they are many, and bend little.
        """
        as_good: dict[str, Rival] = {}
        for swapped in self._swaps(found, name):
            (rival,) = (c for c in swapped.candidates if c.name not in found.names)
            worse = self.cost(swapped) - self.cost(found)
            as_well = worse < RIVAL_MARGIN and swapped.plausible
            # What a form was freed further for, it needs: that is no roominess.
            if as_well and (rival.refines or not _contains(swapped, found)):
                other = Rival(rival.name, worse, swapped.settings)
                as_good[rival.name] = min(other, as_good.get(rival.name, other), key=_dearer)
        rest, scored = self._in_place_of(found, name)
        for s in scored if rest.rss - found.rss < _WEAK else ():
            worse = self.predicted(rest, s) - self.cost(found)
            if s.candidate.name != name and worse < RIVAL_MARGIN and _plausible(s):
                settings = {**rest.settings, **s.starts[0]}
                as_good.setdefault(s.candidate.name, Rival(s.candidate.name, worse, settings))
        return sorted(as_good.values(), key=_dearer)

    def held_out(self, found: Fit) -> HeldOut:
        """How parts that were not fitted are predicted, with and without each effect."""
        without = {name: self.without(found, name) for name in found.names}
        return held_out(self.residuals, self.null, found, without)


def _log_ways(pool: int, count: int) -> float:
    return math.log(math.comb(max(pool, count), count))


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
