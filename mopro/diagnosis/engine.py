"""From a model, a catalogue of effects and data to a verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.model import Candidate, Series, Simulate
from mopro.diagnosis.remainder import Remainder, examine
from mopro.diagnosis.residual import Residuals
from mopro.diagnosis.search import HeldOut, Search
from mopro.diagnosis.verdict import Estimate, Gap, Named, Rejected, Verdict, Where


def reconcile(simulate: Simulate, effects: Sequence[Candidate], data: Sequence[Series]) -> Verdict:
    """Find which of `effects` the model lacks, if any, and how sure that is.

    `simulate(settings)` predicts every series of `data` with the effects in `settings`
    on; it must be deterministic. Raises ValueError for data that are no finite numbers
    and for predictions of another length.
    """
    _check(effects, data)
    search = Search(Residuals(simulate, data), effects)
    found = search.run()
    found, held, dropped = _supported(search, found)
    remainder = examine(data, found.residual, len(found.order))
    if remainder.significant:
        found, doubted = _firm(search, found)
        dropped += doubted
        remainder = examine(data, found.residual, len(found.order))
        held = search.held_out(found) if found.candidates else None
    named = tuple(_named(search, found, held, candidate) for candidate in found.candidates)
    return Verdict(
        verdict=_word(named, remainder),
        effects=named,
        rejected=(*dropped, *_rejected(search, found)),
        where=tuple(_where(search)),
        gap=_gap(search, found, held),
        remainder=remainder,
        settings=found.settings,
    )


def _check(effects: Sequence[Candidate], data: Sequence[Series]) -> None:
    if not data:
        raise ValueError("there are no data")
    for series in data:
        if not len(series) or not np.isfinite(series.values).all():
            raise ValueError(
                f"{series.run}, {series.sensor}: expected finite numbers, at least one"
            )
    names = [effect.name for effect in effects]
    if len(set(names)) < len(names):
        raise ValueError("two effects have the same name")


def _supported(search: Search, found: Fit) -> tuple[Fit, HeldOut | None, list[Rejected]]:
    """`found` without the effects that parts held out do not bear out, one at a time."""
    dropped: list[Rejected] = []
    while found.candidates:
        held = search.held_out(found)
        unborne = [name for name in found.names if not held.supports(name)]
        if not unborne:
            return found, held, dropped
        worst = min(unborne, key=lambda name: held.without[name])
        gain = search.without(found, worst).rss - found.rss
        reason = "fits what it was fitted to, and worsens what was held out"
        dropped.append(Rejected(worst, gain, reason))
        found = search.without(found, worst)
    return found, None, dropped


def _firm(search: Search, found: Fit) -> tuple[Fit, list[Rejected]]:
    """`found` without the effects that may only lean on what nothing accounts for.

    Beside an unexplained remainder an effect is kept if it is not flexible and explains
    more than what is left over.
    """
    doubted: list[Rejected] = []
    while found.candidates:
        excess = found.rss - found.count
        gains = {c: search.without(found, c.name).rss - found.rss for c in found.candidates}
        weak = [c for c, gain in gains.items() if c.flexible or gain < excess]
        if not weak:
            break
        least = min(weak, key=lambda c: gains[c])
        reason = "leaves much unexplained, of which it may be a part"
        doubted.append(Rejected(least.name, gains[least], reason))
        found = search.without(found, least.name)
    return found, doubted


def _word(named: tuple[Named, ...], remainder: Remainder) -> str:
    if remainder.significant:
        return "unexplained"
    if not named:
        return "none"
    return "ambiguous" if any(n.indistinguishable_from for n in named) else "named"


def _named(search: Search, found: Fit, held: HeldOut | None, candidate: Candidate) -> Named:
    estimates = {}
    bounds = found.at_bound()
    for (effect, p), value, interval in zip(
        found.order, found.values, found.intervals(), strict=True
    ):
        if effect == candidate.name:
            stopped = f"{effect}.{p.name}" in bounds
            estimates[p.name] = Estimate(float(value), p.unit, interval, stopped)
    dearer = search.cost(search.without(found, candidate.name)) - search.cost(found)
    return Named(
        name=candidate.name,
        parameters=estimates,
        indistinguishable_from=[name for name, _ in search.rivals(found, candidate.name)],
        log10_bayes_factor=dearer / (2 * math.log(10)),
        held_out=held is not None and held.supports(candidate.name),
    )


def _rejected(search: Search, found: Fit) -> list[Rejected]:
    """What the catalogue still offers, and that it does not pay for itself."""
    return [
        Rejected(s.candidate.name, s.gain, "does not pay for its parameters")
        for s in search.scores(found)
        if s.starts
    ]


def _where(search: Search) -> list[Where]:
    places, start = [], 0
    for series in search.residuals.data:
        own = search.null.residual[start : start + len(series)]
        start += len(series)
        rms = math.sqrt(float(np.mean(own**2))) * (series.sigma or 1.0)
        places.append(Where(series.run, series.sensor, rms, series.sigma))
    return places


def _gap(search: Search, found: Fit, held: HeldOut | None) -> Gap:
    """In the unit of the first series, whose kind alone is counted."""
    data = search.residuals.data
    unit = data[0].unit
    counted = np.concatenate([np.full(len(s), s.unit == unit) for s in data])
    weights = search.residuals.weights
    rms = [
        math.sqrt(float(np.mean((f.residual / weights)[counted] ** 2)))
        for f in (search.null, found)
    ]
    noises = [s.sigma for s in data if s.unit == unit and s.sigma is not None]
    noise = math.sqrt(sum(n**2 for n in noises) / len(noises)) if noises else None
    held_out = None
    if held is not None and all(s.unit == unit for s in data):
        held_out = math.sqrt(held.after) * (noise or 1.0)
    return Gap(unit, rms[0], rms[1], noise, held_out)
