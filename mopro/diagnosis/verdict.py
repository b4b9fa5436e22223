"""What the engine answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mopro.diagnosis.model import Floats, Settings
from mopro.diagnosis.remainder import Remainder


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval; `at_bound` if the range stopped the fit.

    The interval is infinite where the data do not bound it, and not a number where a
    search found the value.
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class Named:
    """An effect that is believed, in which form, and what cannot be told from it.

    `rivals` says how much dearer each of those is, in chi-squared with its price, and
    `alternatives` are all settings with the rival in the place of the effect.
    `log10_bayes_factor` weighs the model with the effect against the one without, its
    price paid, `sigmas` is the size of what it explains in standard deviations of the
    noise, and `held_out` tells whether parts that were not fitted gain by it.
    """

    name: str
    form: str
    parameters: dict[str, Estimate]
    indistinguishable_from: list[str]
    rivals: dict[str, float]
    alternatives: dict[str, Settings]
    log10_bayes_factor: float
    sigmas: float
    held_out: bool


@dataclass(frozen=True)
class Rejected:
    """A candidate that was looked at and not believed, and why."""

    name: str
    gain: float
    reason: str


@dataclass(frozen=True)
class BelowResolution:
    """An effect that these data could not show at any size to expect.

    The largest would come to `expected_sigmas` standard deviations in all; `needed_sigmas`
    are what it takes to be seen.
    """

    name: str
    expected_sigmas: float
    needed_sigmas: float


@dataclass(frozen=True)
class Where:
    """How far one series is off before anything is added."""

    run: str
    sensor: str
    rms: float
    sigma: float | None


@dataclass(frozen=True)
class RunGap:
    """The gap of one series, in its own unit."""

    run: str
    sensor: str
    unit: str
    before_rms: float
    after_rms: float
    held_out_rms: float | None
    noise_rms: float | None


@dataclass(frozen=True)
class Gap:
    """Root mean square of measured less simulated; `held_out` on parts not fitted."""

    unit: str
    before_rms: float
    after_rms: float
    noise_rms: float | None
    held_out_rms: float | None
    runs: tuple[RunGap, ...] = ()


@dataclass(frozen=True)
class Signature:
    """What a named effect adds to each series, in its unit, and the chi-squared it takes away."""

    name: str
    changes: tuple[Floats, ...]
    gain: float


@dataclass(frozen=True)
class Verdict:
    """`none`, `named`, `ambiguous` or `unexplained`, and the grounds for it.

    `before` and `after` are what is left of each series, in its unit, without and with
    the effects named; `next_experiment` is the text of a program that would tell rivals
    apart, if whoever asked can write one. `calibration` are corrections of the model's own
    numbers within their tolerances, which are no findings.
    """

    verdict: str
    effects: tuple[Named, ...]
    rejected: tuple[Rejected, ...]
    below_resolution: tuple[BelowResolution, ...]
    where: tuple[Where, ...]
    gap: Gap
    remainder: Remainder
    settings: Settings
    before: tuple[Floats, ...] = ()
    after: tuple[Floats, ...] = ()
    signatures: tuple[Signature, ...] = ()
    next_experiment: str | None = None
    calibration: tuple[Named, ...] = ()

    @property
    def fitted(self) -> tuple[Named, ...]:
        """All that was added to the model: the effects, and its numbers calibrated."""
        return (*self.effects, *self.calibration)

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "effects": [_effect_json(effect) for effect in self.effects],
            "calibration": [_effect_json(effect) for effect in self.calibration],
            "where": [vars(where) for where in self.where],
            "gap": {
                "unit": self.gap.unit,
                "before_rms": self.gap.before_rms,
                "after_rms": self.gap.after_rms,
                "noise_rms": self.gap.noise_rms,
                "held_out": self.gap.held_out_rms is not None,
                "held_out_rms": self.gap.held_out_rms,
                "runs": [vars(run) for run in self.gap.runs],
            },
            "remainder": {
                "significant": self.remainder.significant,
                "description": self.remainder.description,
                "scatter_sigma": self.remainder.scatter,
            },
            "rejected": [vars(rejected) for rejected in self.rejected],
            "below_resolution": [vars(faint) for faint in self.below_resolution],
            "next_experiment": self.next_experiment,
        }


def _effect_json(effect: Named) -> dict[str, Any]:
    return {
        "name": effect.name,
        "form": effect.form,
        "indistinguishable_from": effect.indistinguishable_from,
        "parameters": {
            name: {"value": e.value, "unit": e.unit, "ci95": list(e.ci95), "at_bound": e.at_bound}
            for name, e in effect.parameters.items()
        },
        "evidence": {
            "log10_bayes_factor": effect.log10_bayes_factor,
            "sigmas": effect.sigmas,
            "held_out": effect.held_out,
            "rivals": effect.rivals,
        },
    }
