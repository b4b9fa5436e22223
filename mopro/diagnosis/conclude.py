"""The answer of the engine, from the final fit: effects, alternatives, gaps, what is not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.heldout import HeldOut
from mopro.diagnosis.model import Candidate, Floats, Mask, Series
from mopro.diagnosis.remainder import Remainder
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

_NO_EVIDENCE = "lowers chi-squared by less than the penalty of its parameters"


def conclude(
    first: Search,
    search: Search,
    fit: Fit,
    held: HeldOut | None,
    remainder: Remainder,
    dropped: Sequence[Rejected],
) -> Verdict:
    """The verdict on `fit`, with all that the evidence says for and against.

    `first` has the data with the noise as stated, `search` those that `fit` was fitted to
    (with the noise inflated beside an unexplained residual). `dropped` are the effects that
    the search found and later passes dropped.
    """
    believed = [(c, _named(search, fit, held, c)) for c in fit.candidates]
    effects = tuple(effect for c, effect in believed if not fit.calibrated(c))
    unseen, rejected = _not_found(search, fit)
    return Verdict(
        verdict=verdict_of(effects, remainder),
        effects=effects,
        rejected=(*dropped, *rejected),
        below_resolution=unseen,
        where=tuple(_where(first)),
        gap=_gap(search, fit, held, first.fits.residuals.data),
        remainder=remainder,
        settings=fit.settings,
        before=tuple(_in_units(search, search.fits.null.residual)),
        after=tuple(_in_units(search, fit.residual)),
        signatures=tuple(_signature(search, fit, name) for name in sorted(fit.names)),
        calibration=tuple(effect for c, effect in believed if fit.calibrated(c)),
    )


def verdict_of(effects: Sequence[Named], remainder: Remainder) -> str:
    """`unexplained`, `none`, `ambiguous` or `named`."""
    if remainder.significant:
        return "unexplained"
    if not effects:
        return "none"
    return "ambiguous" if any(n.indistinguishable_from for n in effects) else "named"


def _named(search: Search, fit: Fit, held: HeldOut | None, candidate: Candidate) -> Named:
    without = search.fits.without(fit, candidate.name)
    delta_ebic = search.fits.ebic(without) - search.fits.ebic(fit)
    alternatives = search.alternatives.of(fit, candidate.name)
    return Named(
        name=candidate.name,
        form=candidate.form,
        parameters=_estimates(fit, candidate),
        indistinguishable_from=[other.name for other in alternatives],
        rivals={other.name: other.delta_ebic for other in alternatives},
        alternatives={other.name: other.settings for other in alternatives},
        log10_bayes_factor=delta_ebic / (2 * math.log(10)),
        sigmas=math.sqrt(max(without.rss - fit.rss, 0.0) / fit.noise_variance),
        held_out=held is not None and held.supports(candidate.name),
    )


def _estimates(fit: Fit, candidate: Candidate) -> dict[str, Estimate]:
    intervals = dict(zip(fit.order, fit.intervals(), strict=True))
    values, bounds = fit.settings[candidate.name], fit.at_bound()
    estimates = {}
    for p in candidate.parameters:
        # A value that a search found has no interval.
        interval = intervals.get((candidate.name, p), (math.nan, math.nan))
        at_bound = f"{candidate.name}.{p.name}" in bounds
        estimates[p.name] = Estimate(float(values[p.name]), p.unit, interval, at_bound)
    return estimates


def _not_found(search: Search, fit: Fit) -> tuple[tuple[BelowResolution, ...], list[Rejected]]:
    """The candidates that are not in `fit`: those that nobody could see, and the others.

    An effect is below the resolution of the sensors if the largest plausible one would lower
    chi-squared by less than its penalty.
    """
    unseen: dict[str, BelowResolution] = {}
    rejected: dict[str, Rejected] = {}
    at = search.fits.null if fit.candidates else fit
    for score in search.screening.scores(fit, at):
        candidate = score.candidate
        expected = search.screening.expected_sigmas(at, candidate)
        needed = math.sqrt(search.screening.penalty(fit, [candidate]))
        if expected is not None and expected < needed:
            unseen.setdefault(candidate.name, BelowResolution(candidate.name, expected, needed))
        else:
            answer = Rejected(candidate.name, score.predicted_reduction, _NO_EVIDENCE)
            rejected.setdefault(candidate.name, answer)
    return tuple(unseen.values()), list(rejected.values())


def _where(search: Search) -> list[Where]:
    """RMS of the residual of each series without any effect."""
    residuals = _in_units(search, search.fits.null.residual)
    return [
        Where(series.run, series.sensor, math.sqrt(float(np.mean(own**2))), series.sigma)
        for series, own in zip(search.fits.residuals.data, residuals, strict=True)
    ]


def _in_units(search: Search, whitened: Floats) -> list[Floats]:
    """A whitened vector as one array for each series, in its unit."""
    return search.fits.residuals.split(whitened / search.fits.residuals.weights)


def _signature(search: Search, fit: Fit, name: str) -> Signature:
    """Change of the prediction of each series by an effect, nuisances projected out."""
    reduced = search.fits.without(fit, name)
    others = {n: values for n, values in fit.settings.items() if n != name}
    change = search.fits.residuals.at(others) - fit.residual
    return Signature(name, tuple(_in_units(search, change)), reduced.rss - fit.rss)


def _gap(search: Search, fit: Fit, held: HeldOut | None, data: Sequence[Series]) -> Gap:
    """RMS residuals of each series, and over all series in the unit of the first."""
    unit = data[0].unit
    counted = np.concatenate([np.full(len(s), s.unit == unit) for s in data])
    weights, null = search.fits.residuals.weights, search.fits.null.residual

    def rms(residual: Floats, mask: Mask = counted) -> float:
        return math.sqrt(float(np.mean((residual / weights)[mask] ** 2)))

    return Gap(
        unit=unit,
        before_rms=rms(null),
        after_rms=rms(fit.residual),
        noise_rms=_noise_rms([s for s in data if s.unit == unit]),
        held_out_rms=None if held is None else rms(held.residual),
        runs=tuple(
            RunGap(
                s.run, s.sensor, s.unit, rms(null, mask), rms(fit.residual, mask),
                None if held is None else rms(held.residual, mask), s.sigma,
            )
            for s, mask in zip(data, _masks(data), strict=True)
        ),
    )  # fmt: skip


def _noise_rms(data: Sequence[Series]) -> float | None:
    """RMS of the noise that is stated, or None where it is stated nowhere."""
    stated = [s.sigma for s in data if s.sigma is not None]
    return math.sqrt(sum(sigma**2 for sigma in stated) / len(stated)) if stated else None


def _masks(data: Sequence[Series]) -> list[Mask]:
    """The samples of each series, as masks of all."""
    ends = np.cumsum([0, *map(len, data)]).tolist()
    samples = np.arange(ends[-1])
    return [(a <= samples) & (samples < b) for a, b in pairwise(ends)]
