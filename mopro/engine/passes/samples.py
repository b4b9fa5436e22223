"""Passes on the data: samples that decide nothing, noise as the data show it, finer steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import special

from mopro.engine.assumed import FALSE_ALARMS, LEAST_SHARE, LINEARITY_ERROR, SAME, TOLERANCE
from mopro.engine.fits import Fit
from mopro.engine.freeform import WithLaws
from mopro.engine.passes.loops import a_pass
from mopro.engine.residuals import Noise, difference_variance, without_rough_ends, without_wild
from mopro.engine.series import Floats, Series, Simulate
from mopro.engine.state import State

# Standard errors by which a variance must be below the stated one to replace it.
_STANDARD_ERRORS = -float(special.ndtri(FALSE_ALARMS / 2))

# A series and its residual, in its unit: the series without some samples, and notes on those.
LeaveOut = Callable[[Series, Floats], tuple[Series, list[str]]]


@a_pass
def set_ends_aside(state: State) -> State:
    """Give no weight to the few samples beyond a jump of the readings near an end of a series.

    Before the search, as an effect may take the shape of such a jump.
    """
    return _left_out(state, state.hypotheses.null, without_rough_ends)


@a_pass
def set_wild_aside(state: State) -> State:
    """Give no weight to wild samples and repeated ones, where there are a few; search again.

    Where those are less of what is left than a prediction is off by, the sets are only fitted
    again: the search would propose the same ones.
    """
    again = _left_out(state, state.fit, without_wild)
    if again is state:
        return state
    out = np.concatenate([~series.counted for series in again.problem.data])
    decided = float(np.sum(state.fit.residual[out] ** 2))
    if decided > LINEARITY_ERROR * (state.fit.rss - state.hypotheses.noise_rss(state.fit)):
        return again
    again.hypotheses.fit_again(state.hypotheses)
    return replace(again, fit=again.hypotheses.best(), searched=True)


def _left_out(state: State, fit: Fit, without: LeaveOut) -> State:
    """`state` without the samples that `without` leaves out by what `fit` leaves of a series."""
    left = state.hypotheses.residuals.in_units(fit.residual)
    parts = [without(series, own) for series, own in zip(state.problem.data, left, strict=True)]
    notes = tuple(note for _, own in parts for note in own)
    if not notes:
        return state
    data = tuple(series for series, _ in parts)
    return state.begun(replace(state.problem, data=data), (*state.notes, *notes))


@a_pass
def refine_steps(state: State) -> State:
    """A finer simulation, where the steps of this one may be what remains; search again."""
    finer = state.problem.finer
    if finer is None or state.hypotheses.is_noise(state.fit) or not _steps_matter(state, finer):
        return state
    state.problem.progress("refitting with a finer simulation")
    finer = WithLaws(finer, state.problem.data, ())
    coarse = state.problem.simulate
    return state.begun(replace(state.problem, simulate=finer, finer=None, coarse=coarse))


def _steps_matter(state: State, finer: Simulate) -> bool:
    """True if a residual beyond noise may come from the steps of the coarse simulation."""
    fit, residuals = state.fit, state.hypotheses.residuals
    fine = residuals.of_model(finer, None).at(fit.settings)
    # Sensor noise that wanders is not white, hides no effect, and looks like one.
    most = 1.0 if residuals.known_noise else np.inf
    parts = residuals.split(fit.residual)
    white = sum(len(own) * min(difference_variance(own), most) for own in parts)
    # A change of δ takes at most 2 δ √excess away.
    share = (LEAST_SHARE / 2) ** 2
    least = max(SAME * state.hypotheses.scale(fit), share * (fit.rss - white))
    return float(np.sum((fine - fit.residual) ** 2)) > least


@a_pass
def restate_quiet_noise(state: State) -> State:
    """The noise that the data show, where they are quieter than stated; search again."""
    hypotheses = state.hypotheses
    mean = hypotheses.evidence.noise.sums(state.fit.residual) / np.array(
        hypotheses.evidence.noise.counts
    )
    samples = Noise.as_stated(hypotheses.residuals).like(state.fit.residual).samples
    below = mean * (1 + _STANDARD_ERRORS * np.sqrt(2 / samples)) < (1 + TOLERANCE) ** -2
    data, notes, restated = [], list(state.notes), False
    for series, is_below, m in zip(state.problem.data, below, mean, strict=True):
        if series.sigma is not None and is_below:
            sigma = series.sigma * float(np.sqrt(m))
            notes.append(
                f"{series.sensor} in {series.run} is quieter than stated: its noise is "
                f"{sigma:.3g} {series.unit}, {np.sqrt(m):.2g} times as much"
            )
            # A sensor at rest shows none of its noise, and is no measure of it.
            if m > LEAST_SHARE**2:
                series, restated = replace(series, sigma=sigma), True
        data.append(series)
    if not restated:
        return replace(state, notes=tuple(notes))
    return state.begun(replace(state.problem, data=tuple(data)), tuple(notes))
