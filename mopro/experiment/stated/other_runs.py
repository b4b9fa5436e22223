"""Predictions of runs of another motion, and how far apart two fitted sets are there."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.series import Settings, key_of
from mopro.engine.verdict import Verdict, rms
from mopro.experiment.separation import AMPLE_SIGMAS, distance
from mopro.experiment.stated.other_motions import Motion, moved, other_motions
from mopro.formula.evaluate import Floats
from mopro.stated.data import Run
from mopro.stated.reading_series import plain_series
from mopro.stated.simulation import Model


@dataclass(frozen=True)
class Apart:
    """Difference of two predictions of a run (σ): `sigmas` over all samples, `rms` of a sample."""

    sigmas: float
    rms: float

    @property
    def told(self) -> bool:
        """True if data tell them apart, of a model that is exact to a tenth of the noise."""
        return self.sigmas >= AMPLE_SIGMAS and self.rms > LEAST_SHARE


NOT_APART = Apart(0.0, 0.0)
_MOST_RUNS = 8


class OtherRun:
    """A run in another motion, as fitted sets predict it.

    `nth`: of the runs of `model`. `noise`: standard deviation of each of its readings, in its unit.
    """

    def __init__(self, model: Model, motion: Motion, nth: int, noise: Sequence[float]) -> None:
        runs = list(model.experiment.trials)
        self.motion = motion
        self.run = runs[nth] = moved(model, motion, runs[nth])
        # A number of one run finds it by its name and place among the others.
        self.model = model.on(runs)
        self._series = [s for s in plain_series(self.model) if s.run == self.run.name]
        self._noise = noise
        self._known: dict[Hashable, Floats] = {}

    @property
    def duration_s(self) -> float:
        return float(np.ptp(self.run.time_s))

    def under(self, settings: Settings) -> Floats:
        """All readings in σ of their noise, less what is fitted to each run, such as an offset."""
        key = key_of(settings)
        if key not in self._known:
            readings = self.model.of(self.run, settings)
            parts = zip(self._series, readings, self._noise, strict=True)
            self._known[key] = np.concatenate([s.without_nuisances(r) / n for s, r, n in parts])
        return self._known[key]

    def apart(self, one: Settings, other: Settings, base: Settings, size_error: float) -> Apart:
        """Difference of the predictions of two sets, less what the size of the other could undo.

        `size_error`: relative standard error of that size; `base`: the settings without either.
        NOT_APART where the model runs away.
        """
        first, second, without = (self.under(each) for each in (one, other, base))
        difference, free = first - second, size_error * (second - without)
        if not (np.isfinite(difference).all() and np.isfinite(free).all()):
            return NOT_APART
        return Apart(distance(difference, free[:, None]), rms(difference))


def other_runs(model: Model, verdict: Verdict) -> list[OtherRun]:
    """Each run, of many the first few, in each other motion.

    The noise is as stated or, where it is not, as was left.
    """
    by_run: dict[str, list[float]] = {run.name: [] for run in model.experiment.trials}
    for (run, _), gap in zip(model.readings, verdict.gap.runs, strict=True):
        by_run[run.name].append(gap.noise_rms or gap.after_rms)
    return [
        OtherRun(model, motion, nth, by_run[run.name])
        for motion in other_motions(model)
        for nth, run in enumerate(model.experiment.trials[:_MOST_RUNS])
        if all(by_run[run.name])
    ]


def states(model: Model, run: Run, settings: Settings) -> dict[str, Floats]:
    """States (rows, SI) of the machine in a run, with the speed of an axis."""
    found = model.values_in(run, settings)
    return {name: own for name, own in found.items() if name not in {"t", "a", *run.inputs}}
