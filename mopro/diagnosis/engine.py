"""From a model, a catalogue of effects and data to a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fits import Fits, Progress
from mopro.diagnosis.heldout import HeldOut
from mopro.diagnosis.model import Candidate, Floats, Series, Simulate
from mopro.diagnosis.remainder import Remainder, examine
from mopro.diagnosis.residual import Residuals, white_variance
from mopro.diagnosis.search import Search
from mopro.diagnosis.verdict import (
    BelowResolution,
    Estimate,
    Gap,
    Named,
    Rejected,
    RunGap,
    Signature,
    Verdict,
    Where,
)

# What a finer simulation may move a prediction by, in chi-squared, before it matters.
_NUMERICS_MATTER = 1.0
# The same as a share of the excess that is left over: a change of δ takes at most 2 δ √excess
# away, so this is what could account for a tenth of it.
_SHARE_OF_EXCESS = 0.05**2
# So many times what is left over an effect must explain beside it: of any slow disturbance one or
# another signature of a catalogue takes three quarters.
_OUTWEIGHS = 10.0


def reconcile(
    simulate: Simulate,
    effects: Sequence[Candidate],
    data: Sequence[Series],
    *,
    finer: Simulate | None = None,
    jobs: int = 1,
    progress: Progress = lambda _: None,
) -> Verdict:
    """Find which of `effects` the model lacks, if any, and how sure that is.

    `simulate(settings)` predicts every series of `data` with the effects in `settings`
    on; it must be deterministic. `finer` is the same model integrated more finely: it is
    asked before anything is called unexplained. `jobs` threads simulate at once, and
    `progress` is told what is being done. Raises ValueError for data that are no finite
    numbers and for predictions of another length.
    """
    _check(effects, data)
    search = Search(Fits(Residuals(simulate, data), effects, jobs, progress))
    found = search.run()
    if finer is not None and _numerics_matter(search, found, finer):
        progress("refitting with a finer simulation")
        search = Search(Fits(Residuals(finer, data), effects, jobs, progress))
        found = search.run()
    return _judged(search, found)


def _numerics_matter(search: Search, found: Fit, finer: Simulate) -> bool:
    """Whether something is left over that a coarse simulation may have caused."""
    if not examine(search.fits.residuals, found.residual, len(found.order)).significant:
        return False
    other = Residuals(finer, search.fits.residuals.data).at(found.settings)
    enough = max(
        _NUMERICS_MATTER * found.variance,
        _SHARE_OF_EXCESS * (found.rss - _noise(search, found)),
    )
    return float(np.sum((other - found.residual) ** 2)) > enough


def _judged(search: Search, found: Fit) -> Verdict:
    residuals, where = search.fits.residuals, tuple(_where(search))
    found, held, dropped = _supported(search, found)
    remainder = examine(residuals, found.residual, len(found.order))
    if remainder.significant:
        found, doubted = _firm(search, found)
        dropped += doubted
        remainder = examine(residuals, found.residual, len(found.order))
        search, found = _burdened(search, found)
        held = search.fits.held_out(found) if found.candidates else None
    fitted = [(c, _named(search, found, held, c)) for c in found.candidates]
    named = tuple(effect for c, effect in fitted if not found.calibrated(c))
    faint, rejected = _others(search, found)
    return Verdict(
        verdict=_word(named, remainder),
        effects=named,
        rejected=(*dropped, *rejected),
        below_resolution=faint,
        where=where,
        gap=_gap(search, found, held, residuals.data),
        remainder=remainder,
        settings=found.settings,
        before=tuple(_in_units(search, search.fits.null.residual)),
        after=tuple(_in_units(search, found.residual)),
        signatures=tuple(_signature(search, found, name) for name in sorted(found.names)),
        calibration=tuple(effect for c, effect in fitted if found.calibrated(c)),
    )


def _check(effects: Sequence[Candidate], data: Sequence[Series]) -> None:
    if not data:
        raise ValueError("there are no data")
    for series in data:
        if series.sigma is not None and not series.sigma > 0:
            raise ValueError(f"{series.run}, {series.sensor}: expected a sigma above 0, or None")
        if not len(series) or not np.isfinite(series.values).all():
            raise ValueError(
                f"{series.run}, {series.sensor}: expected finite numbers, at least one"
            )
    keys = [effect.key for effect in effects]
    if len(set(keys)) < len(keys):
        raise ValueError("two effects have the same name and form")


def _supported(search: Search, found: Fit) -> tuple[Fit, HeldOut | None, list[Rejected]]:
    """`found` without the effects that parts held out do not bear out, one at a time."""
    dropped: list[Rejected] = []
    while found.candidates:
        held = search.fits.held_out(found)
        unborne = [name for name in found.names if held and not held.supports(name)]
        if not held or not unborne:
            return found, held, dropped
        worst = min(unborne, key=lambda name: held.without[name])
        gain = search.fits.without(found, worst).rss - found.rss
        reason = "fits what it was fitted to, and worsens what was held out"
        dropped.append(Rejected(worst, gain, reason))
        found = search.fits.without(found, worst)
    return found, None, dropped


def _firm(search: Search, found: Fit) -> tuple[Fit, list[Rejected]]:
    """`found` without the effects that may only lean on what nothing accounts for.

    Beside an unexplained remainder an effect is kept if it is not flexible and explains
    many times what the rigid ones together leave over.
    """
    doubted: list[Rejected] = []

    def dropped(found: Fit, gains: Mapping[str, float]) -> Fit:
        least = min(gains, key=lambda name: gains[name])
        reason = "leaves much unexplained, of which it may be a part"
        doubted.append(Rejected(least, gains[least], reason))
        return search.fits.without(found, least)

    def gains_of(names: Iterable[str]) -> dict[str, float]:
        return {name: search.fits.without(found, name).rss - found.rss for name in names}

    while flexible := gains_of(c.name for c in found.candidates if c.flexible):
        found = dropped(found, flexible)
    enough = _OUTWEIGHS * (found.rss - _noise(search, found))
    while weak := {n: gain for n, gain in gains_of(found.names).items() if gain < enough}:
        found = dropped(found, weak)
    return found, doubted


def _burdened(search: Search, found: Fit) -> tuple[Search, Fit]:
    """`found` among noise as strong as what it leaves, and the search for what can replace it.

    What nothing accounts for bears on every number beside it, the more the slower it varies:
    as white noise it would tell a family apart, and give intervals that do not hold the truth.
    """
    if not found.candidates:
        return search, found
    known = search.fits
    burdened = Search(
        Fits(known.residuals.burdened(found.residual), known.catalogue, known.jobs, known.progress)
    )
    return burdened, burdened.settled_at(found)


def _noise(search: Search, found: Fit) -> float:
    """The sum of squares that white noise alone would leave.

    As much as neighbouring samples say, and no more than is known: a sensor's noise that
    wanders hides no effect, but looks like one.
    """
    most = 1.0 if found.known_noise else math.inf
    parts = search.fits.residuals.split(found.residual)
    return sum(len(part) * min(white_variance(part), most) for part in parts)


def _word(named: tuple[Named, ...], remainder: Remainder) -> str:
    if remainder.significant:
        return "unexplained"
    if not named:
        return "none"
    return "ambiguous" if any(n.indistinguishable_from for n in named) else "named"


def _named(search: Search, found: Fit, held: HeldOut | None, candidate: Candidate) -> Named:
    intervals = dict(zip(found.order, found.intervals(), strict=True))
    values, bounds = found.settings[candidate.name], found.at_bound()
    estimates = {}
    for p in candidate.parameters:
        value = float(values[p.name])
        # What a search of its own found has none.
        interval = intervals.get((candidate.name, p), (math.nan, math.nan))
        stopped = f"{candidate.name}.{p.name}" in bounds
        estimates[p.name] = Estimate(value, p.unit, interval, stopped)
    without = search.fits.without(found, candidate.name)
    dearer = search.fits.cost(without) - search.fits.cost(found)
    rivals = search.rivals.of(found, candidate.name)
    return Named(
        name=candidate.name,
        form=candidate.form,
        parameters=estimates,
        indistinguishable_from=[rival.name for rival in rivals],
        rivals={rival.name: rival.dearer for rival in rivals},
        alternatives={rival.name: rival.settings for rival in rivals},
        log10_bayes_factor=dearer / (2 * math.log(10)),
        sigmas=math.sqrt(max(without.rss - found.rss, 0.0) / found.variance),
        held_out=held is not None and held.supports(candidate.name),
    )


def _others(search: Search, found: Fit) -> tuple[tuple[BelowResolution, ...], list[Rejected]]:
    """What the catalogue offers besides: what does not pay, and what nobody could see.

    An effect is below what the sensors resolve if even the largest one to expect would
    not pay for its parameters.
    """
    faint: dict[str, BelowResolution] = {}
    rejected: dict[str, Rejected] = {}
    near = search.fits.null if found.candidates else found
    for scored in search.promises.scores(found, near):
        candidate = scored.candidate
        expected = search.promises.expected_sigmas(near, candidate)
        needed = math.sqrt(search.promises.dearer(found, candidate))
        if expected is not None and expected < needed:
            faint.setdefault(candidate.name, BelowResolution(candidate.name, expected, needed))
        else:
            reason = "does not pay for its parameters"
            rejected.setdefault(candidate.name, Rejected(candidate.name, scored.gain, reason))
    return tuple(faint.values()), list(rejected.values())


def _where(search: Search) -> list[Where]:
    places = []
    parts = _in_units(search, search.fits.null.residual)
    for series, own in zip(search.fits.residuals.data, parts, strict=True):
        rms = math.sqrt(float(np.mean(own**2)))
        places.append(Where(series.run, series.sensor, rms, series.sigma))
    return places


def _in_units(search: Search, whitened: Floats) -> list[Floats]:
    return search.fits.residuals.split(whitened / search.fits.residuals.weights)


def _signature(search: Search, found: Fit, name: str) -> Signature:
    """What an effect adds to the prediction of each series, nuisances taken out."""
    rest = search.fits.without(found, name)
    kept = {n: values for n, values in found.settings.items() if n != name}
    change = search.fits.residuals.at(kept) - found.residual
    return Signature(name, tuple(_in_units(search, change)), rest.rss - found.rss)


def _gap(search: Search, found: Fit, held: HeldOut | None, data: Sequence[Series]) -> Gap:
    """In the unit of the first series of `data`, whose kind alone is counted."""
    unit = data[0].unit
    counted = np.concatenate([np.full(len(s), s.unit == unit) for s in data])
    weights = search.fits.residuals.weights

    def rms(residual: Floats, mask: Floats = counted) -> float:
        return math.sqrt(float(np.mean((residual / weights)[mask] ** 2)))

    noises = [s.sigma for s in data if s.unit == unit and s.sigma is not None]
    noise = math.sqrt(sum(n**2 for n in noises) / len(noises)) if noises else None
    ends = np.cumsum([0, *map(len, data)]).tolist()
    masks = []
    for first, last in pairwise(ends):
        mask = np.zeros(ends[-1], dtype=bool)
        mask[first:last] = True
        masks.append(mask)
    return Gap(
        unit=unit,
        before_rms=rms(search.fits.null.residual),
        after_rms=rms(found.residual),
        noise_rms=noise,
        held_out_rms=None if held is None else rms(held.residual),
        runs=tuple(
            RunGap(
                s.run, s.sensor, s.unit, rms(search.fits.null.residual, mask),
                rms(found.residual, mask), None if held is None else rms(held.residual, mask),
                s.sigma,
            )
            for s, mask in zip(data, masks, strict=True)
        ),
    )  # fmt: skip
