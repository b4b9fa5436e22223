"""Verdicts beside the noise of inputs: stated, or as large as they look where nothing is stated."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mopro.engine.residuals import Residuals
from mopro.engine.series import Settings
from mopro.engine.verdict import Verdict
from mopro.experiment.stated.study import Study
from mopro.formula import factor_of
from mopro.stated.input_noise import (
    InputNoise,
    apparent_noise,
    beside_input_noise,
    stated_noise,
)


def beside_noise(study: Study, asked: Callable[[Study], Verdict]) -> tuple[Study, Verdict]:
    """The verdict that `asked` gives, and the study that it is of.

    What an input does from row to row is the machine's drive, or noise of its measurement. Where
    no file says so, of the verdicts on exact and on noisy inputs the one of the lower BIC (Schwarz
    1978) is taken. None is asked for on noisy ones where exact ones leave nothing to explain, or
    noise explains less than its terms cost of what is left without effects and with those named.
    """
    if study.model.foreign is not None:
        return study, asked(study)
    if stated := stated_noise(study.model):
        return _beside(study, stated, asked)
    verdict, noises = asked(study), apparent_noise(study.model)
    if verdict.verdict == "none" or not noises or not all(s.sigma for s in study.series):
        return study, verdict
    exact = _bic(study, verdict)
    heard = _heard(study, noises, study.base.settings)
    if min(_bic(heard, verdict), _deviance(heard, study.base.settings)) > exact:
        return study, verdict
    noisy, other = _beside(study, noises, asked)
    if _bic(noisy, other) > exact:
        return study, verdict
    notes = (*study.experiment.notes, *_notes(study, noises))
    return replace(noisy, experiment=replace(study.experiment, notes=notes)), other


def _beside(
    study: Study, noises: Sequence[InputNoise], asked: Callable[[Study], Verdict]
) -> tuple[Study, Verdict]:
    """The verdict beside noise, of which the machine makes what it does with what is named."""
    heard = _heard(study, noises, study.base.settings)
    verdict = asked(heard)
    if not verdict.effects:
        return heard, verdict
    heard = _heard(study, noises, verdict.settings_alone)
    return heard, asked(heard)


def _heard(study: Study, noises: Sequence[InputNoise], settings: Settings) -> Study:
    series = beside_input_noise(study.model, settings, study.series, noises)
    return replace(study, series=series)


def _bic(study: Study, verdict: Verdict) -> float:
    """The Bayesian information criterion of the effects that a verdict names."""
    numbers = sum(len(effect.parameters) for effect in verdict.effects)
    samples = sum(map(len, study.series))
    return _deviance(study, verdict.settings_alone) + numbers * math.log(samples)


def _deviance(study: Study, settings: Settings) -> float:
    """-2 ln L of the data, but for what is the same with any settings."""
    residuals = Residuals(study.model, study.series).calibrated_at(study.base.settings)
    return float(np.sum(residuals.at(settings) ** 2)) + residuals.log_determinant


def _notes(study: Study, noises: Sequence[InputNoise]) -> Iterator[str]:
    for name, unit in study.experiment.units.items():
        own = [noise.rms for noise in noises if noise.name == name]
        if own:
            rms = max(own) / factor_of(unit)
            yield (
                f"{name} changes from row to row by {rms:.3g} {unit}, which the readings show "
                "nothing of: it is taken for noise of its measurement; state its noise_rms in "
                "[inputs], 0 if it is exact"
            )
