"""Answer of the engine: verdict, effects with their evidence, gaps, and its JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mopro.diagnosis.model import Floats, Settings
from mopro.diagnosis.remainder import Remainder


@dataclass(frozen=True)
class Estimate:
    """Value of a parameter with its 95 % interval, both in `unit`.

    The interval is infinite where the data do not bound it, and not a number where a search
    found the value. `at_bound`: the fit was stopped by an end of the parameter's range.
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class Named:
    """An effect that is believed, with the alternatives that the data cannot tell from it.

    `rivals`: EBIC of each alternative above that of the effect, within 10. `alternatives`: all
    settings with the alternative in the place of the effect. `log10_bayes_factor`: half the
    EBIC that the effect saves, over ln 10 (Kass and Raftery 1995). `sigmas`: root of the
    chi-squared that it explains. `held_out`: parts that were not fitted are predicted better
    with it.
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
    """A candidate that is not believed, and why; `gain` is its reduction of chi-squared."""

    name: str
    gain: float
    reason: str


@dataclass(frozen=True)
class BelowResolution:
    """An effect that these data could not show at any plausible size.

    `expected_sigmas`: root of the chi-squared of the largest plausible one; `needed_sigmas`:
    root of its penalty.
    """

    name: str
    expected_sigmas: float
    needed_sigmas: float


@dataclass(frozen=True)
class Where:
    """RMS residual of one series before any effect is added, and its noise, in its unit."""

    run: str
    sensor: str
    rms: float
    sigma: float | None


@dataclass(frozen=True)
class RunGap:
    """RMS residuals of one series, in its own unit."""

    run: str
    sensor: str
    unit: str
    before_rms: float
    after_rms: float
    held_out_rms: float | None
    noise_rms: float | None


@dataclass(frozen=True)
class Gap:
    """RMS of measured - simulated, in `unit`; `held_out_rms` that of parts not fitted."""

    unit: str
    before_rms: float
    after_rms: float
    noise_rms: float | None
    held_out_rms: float | None
    runs: tuple[RunGap, ...] = ()


@dataclass(frozen=True)
class Signature:
    """Change of each series by an effect, in its unit, and its reduction of chi-squared."""

    name: str
    changes: tuple[Floats, ...]
    gain: float


@dataclass(frozen=True)
class Verdict:
    """`none`, `named`, `ambiguous` or `unexplained`, and the evidence for it.

    `before` and `after`: the residual of each series, in its unit, without and with the
    effects. `settings`: all that was fitted. `next_experiment`: the text of a program that
    would tell alternatives apart, if the caller writes one. `calibration`: corrections of the
    model's own numbers within their tolerances, which are no findings.
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
        """All that was added to the model: the effects and the calibrations."""
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
