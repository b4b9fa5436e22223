"""Verdicts beside the noise of inputs: stated, or as large as they look where nothing is stated."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.engine.residuals import Residuals
from mopro.engine.series import Series, Settings
from mopro.engine.verdict import Verdict
from mopro.formula import factor_of
from mopro.stated.data import StatedExperiment
from mopro.stated.input_noise import (
    InputNoise,
    apparent_noise,
    beside_input_noise,
    stated_noise,
)
from mopro.stated.simulation import Model

Ask = Callable[[Sequence[Series]], Verdict]


@dataclass(frozen=True)
class _Beside:
    """A model, its series on exact inputs, and the settings of its free numbers without effects."""

    model: Model
    series: Sequence[Series]
    settings: Settings

    def noise(self, noises: Sequence[InputNoise], settings: Settings) -> tuple[Series, ...]:
        """The series beside noise of the inputs, as the machine makes it at `settings`."""
        return beside_input_noise(self.model, settings, self.series, noises)

    def asked(
        self, noises: Sequence[InputNoise], series: Sequence[Series], ask: Ask
    ) -> tuple[Sequence[Series], Verdict]:
        """The verdict beside noise, of which the machine makes what it does with what is named.

        `series`: those beside the noise as the machine makes it without effects.
        """
        verdict = ask(series)
        if not verdict.effects:
            return series, verdict
        series = self.noise(noises, verdict.settings_alone)
        return series, ask(series)

    def bic(self, series: Sequence[Series], verdict: Verdict) -> float:
        """The Bayesian information criterion of the effects that a verdict names."""
        numbers = sum(len(effect.parameters) for effect in verdict.effects)
        samples = sum(map(len, series))
        return self.deviance(series, verdict.settings_alone) + numbers * math.log(samples)

    def deviance(self, series: Sequence[Series], settings: Settings) -> float:
        """-2 ln L of the data, but for what is the same with any settings."""
        residuals = Residuals(self.model, series).calibrated_at(self.settings)
        return float(np.sum(residuals.at(settings) ** 2)) + residuals.log_determinant


def beside_noise(
    model: Model, series: Sequence[Series], settings: Settings, ask: Ask
) -> tuple[Sequence[Series], Verdict, list[str]]:
    """The verdict that `ask` gives, the series that it is of, and notes.

    What an input does from row to row is the machine's drive, or noise of its measurement. Where
    no file says so, of the verdicts on exact and on noisy inputs the one of the lower BIC (Schwarz
    1978) is taken. None is asked for on noisy ones where exact ones leave nothing to explain, no
    reading shows the noise, or it explains less than its terms cost of what is left without effects
    and with those named.
    """
    if model.foreign is not None:
        return series, ask(series), []
    own = _Beside(model, series, settings)
    if stated := stated_noise(model):
        return (*own.asked(stated, own.noise(stated, settings), ask), [])
    verdict, noises = ask(series), apparent_noise(model)
    if verdict.verdict == "none" or not noises or not all(s.sigma for s in series):
        return series, verdict, []
    exact, heard = own.bic(series, verdict), own.noise(noises, settings)
    if all(map(operator.is_, heard, series)):
        return series, verdict, []
    if min(own.bic(heard, verdict), own.deviance(heard, settings)) > exact:
        return series, verdict, []
    noisy, other = own.asked(noises, heard, ask)
    if own.bic(noisy, other) > exact:
        return series, verdict, []
    return noisy, other, [*_notes(model.experiment, noises)]


def _notes(experiment: StatedExperiment, noises: Sequence[InputNoise]) -> Iterator[str]:
    for name, unit in experiment.units.items():
        own = [noise.rms for noise in noises if noise.name == name]
        if own:
            rms = max(own) / factor_of(unit)
            yield (
                f"{name} changes from row to row by {rms:.3g} {unit}, which the readings show "
                "nothing of: it is taken for noise of its measurement; state its noise_rms in "
                "[inputs], 0 if it is exact"
            )
