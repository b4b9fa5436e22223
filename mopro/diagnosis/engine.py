"""The passes of the diagnosis, from a model, a catalogue of effects and data to a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from mopro.diagnosis.conclude import conclude
from mopro.diagnosis.fit import Fit
from mopro.diagnosis.fit_cache import FitCache, Progress
from mopro.diagnosis.heldout import HeldOut
from mopro.diagnosis.model import Candidate, Series, Simulate
from mopro.diagnosis.remainder import examine
from mopro.diagnosis.residual import Residuals, difference_variance
from mopro.diagnosis.search import Search
from mopro.diagnosis.verdict import Rejected, Verdict

# Chi-squared by which a finer simulation must move a prediction to be used: less cannot tell two
# explanations apart.
_STEP_ERROR = 1.0
# The same as a share of the unexplained excess: a change of δ takes at most 2 δ √excess away, so
# this is what could account for a tenth of it. Doubled, a seventh.
_STEP_ERROR_SHARE = 0.05**2
# An effect is believed beside an unexplained residual if its reduction of chi-squared is this many
# times the unexplained excess: of any slow disturbance, one or another signature of a catalogue
# takes three quarters, which is three times what it leaves.
_MASKED_FACTOR = 10.0

_FAILS_CV = "lowers chi-squared where it is fitted, and raises it where it is held out"
_MIMICS = "is flexible enough to be a part of what remains unexplained"
_MASKED = (
    f"explains less than {_MASKED_FACTOR:g} times what remains unexplained, and may be a part of it"
)


def reconcile(
    simulate: Simulate,
    effects: Sequence[Candidate],
    data: Sequence[Series],
    *,
    finer: Simulate | None = None,
    jobs: int = 1,
    progress: Progress = lambda _: None,
) -> Verdict:
    """Find which of `effects` the model lacks, if any, with the evidence for each.

    `simulate(settings)` predicts every series of `data` with the effects in `settings` on; it
    must be deterministic. `finer` is the same model with smaller steps of integration, asked
    before anything is called unexplained. `jobs` simulations run at once, in threads, and
    `progress` is called with a line about each fit. Raises ValueError for data that are not
    finite numbers and for predictions of another length.
    """
    _check(effects, data)
    search = Search(FitCache(Residuals(simulate, data), effects, jobs, progress))
    fit = search.run()
    if finer is not None and _step_error_matters(search, fit, finer):
        progress("refitting with a finer simulation")
        search = Search(FitCache(Residuals(finer, data), effects, jobs, progress))
        fit = search.run()
    return _judged(search, fit)


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


def _step_error_matters(search: Search, fit: Fit, finer: Simulate) -> bool:
    """True if a residual beyond noise may come from the steps of the coarse simulation."""
    if not examine(search.fits.residuals, fit.residual, len(fit.order)).significant:
        return False
    fine = Residuals(finer, search.fits.residuals.data).at(fit.settings)
    least = max(
        _STEP_ERROR * fit.noise_variance,
        _STEP_ERROR_SHARE * (fit.rss - _white_noise_rss(search, fit)),
    )
    return float(np.sum((fine - fit.residual) ** 2)) > least


def _judged(search: Search, fit: Fit) -> Verdict:
    """The verdict on the set of effects that the search found.

    Effects that held-out data or an unexplained residual speak against are dropped; beside such
    a residual the others are weighed again with noise as strong as that.
    """
    fit, held, rejected = drop_if_cv_fails(search, fit)
    remainder = examine(search.fits.residuals, fit.residual, len(fit.order))
    if not remainder.significant:
        return conclude(search, search, fit, held, remainder, rejected)
    fit, masked = drop_if_masked(search, fit)
    remainder = examine(search.fits.residuals, fit.residual, len(fit.order))
    again, fit = _with_inflated_noise(search, fit)
    held = again.fits.held_out(fit) if fit.candidates else None
    return conclude(search, again, fit, held, remainder, [*rejected, *masked])


def drop_if_cv_fails(search: Search, fit: Fit) -> tuple[Fit, HeldOut | None, list[Rejected]]:
    """Drop effects that cross-validation does not support, one at a time, the worst first."""
    rejected: list[Rejected] = []
    while fit.candidates:
        held = search.fits.held_out(fit)
        failing = [name for name in sorted(fit.names) if held and not held.supports(name)]
        if not held or not failing:
            return fit, held, rejected
        worst = min(failing, key=lambda name: held.without[name])
        reduced = search.fits.without(fit, worst)
        rejected.append(Rejected(worst, reduced.rss - fit.rss, _FAILS_CV))
        fit = reduced
    return fit, None, rejected


def drop_if_masked(search: Search, fit: Fit) -> tuple[Fit, list[Rejected]]:
    """Drop effects that may be a part of the unexplained residual, the smallest first.

    First the flexible ones, then those whose reduction of chi-squared is less than ten times
    the excess that the rigid ones together leave.
    """
    rejected: list[Rejected] = []

    def smallest_dropped(fit: Fit, reductions: Mapping[str, float], reason: str) -> Fit:
        least = min(reductions, key=lambda name: reductions[name])
        rejected.append(Rejected(least, reductions[least], reason))
        return search.fits.without(fit, least)

    def reductions(names: Iterable[str]) -> dict[str, float]:
        return {name: search.fits.without(fit, name).rss - fit.rss for name in sorted(names)}

    while flexible := reductions(c.name for c in fit.candidates if c.flexible):
        fit = smallest_dropped(fit, flexible, _MIMICS)
    least = _MASKED_FACTOR * (fit.rss - _white_noise_rss(search, fit))
    while masked := {n: fall for n, fall in reductions(fit.names).items() if fall < least}:
        fit = smallest_dropped(fit, masked, _MASKED)
    return fit, rejected


def _with_inflated_noise(search: Search, fit: Fit) -> tuple[Search, Fit]:
    """A search with noise as strong as the residual, and the effects of `fit` fitted to it.

    An unexplained residual adds to the error of every parameter, the more the slower it varies:
    taken for white noise it would tell alternatives apart that it does not, and give intervals
    that are too narrow.
    """
    if not fit.candidates:
        return search, fit
    known = search.fits
    again = Search(
        FitCache(
            known.residuals.with_inflated_noise(fit.residual),
            known.catalogue,
            known.jobs,
            known.progress,
        )
    )
    return again, again.refitted(fit)


def _white_noise_rss(search: Search, fit: Fit) -> float:
    """Sum of squares of the white noise in the residual, by successive differences.

    At most that of the noise that is stated: sensor noise that wanders is not white, and hides
    no effect, but looks like one.
    """
    most = 1.0 if fit.known_noise else math.inf
    by_series = search.fits.residuals.split(fit.residual)
    return sum(len(own) * min(difference_variance(own), most) for own in by_series)
