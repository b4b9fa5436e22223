"""What the engine answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mopro.diagnosis.model import Settings
from mopro.diagnosis.remainder import Remainder


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval; `at_bound` if the range stopped the fit."""

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class Named:
    """An effect that is believed, and what cannot be told from it on these data.

    `log10_bayes_factor` weighs the model with it against the one without, its price
    paid; `held_out` tells whether parts that were not fitted gain by it.
    """

    name: str
    parameters: dict[str, Estimate]
    indistinguishable_from: list[str]
    log10_bayes_factor: float
    held_out: bool


@dataclass(frozen=True)
class Rejected:
    """A candidate that was looked at and not believed, and why."""

    name: str
    gain: float
    reason: str


@dataclass(frozen=True)
class Where:
    """How far one series is off before anything is added."""

    run: str
    sensor: str
    rms: float
    sigma: float | None


@dataclass(frozen=True)
class Gap:
    """Root mean square of measured less simulated; `held_out` on parts not fitted."""

    unit: str
    before_rms: float
    after_rms: float
    noise_rms: float | None
    held_out_rms: float | None


@dataclass(frozen=True)
class Verdict:
    """`none`, `named`, `ambiguous` or `unexplained`, and the grounds for it."""

    verdict: str
    effects: tuple[Named, ...]
    rejected: tuple[Rejected, ...]
    where: tuple[Where, ...]
    gap: Gap
    remainder: Remainder
    settings: Settings

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "effects": [_effect_json(effect) for effect in self.effects],
            "where": [vars(where) for where in self.where],
            "gap": {
                "unit": self.gap.unit,
                "before_rms": self.gap.before_rms,
                "after_rms": self.gap.after_rms,
                "noise_rms": self.gap.noise_rms,
                "held_out": self.gap.held_out_rms is not None,
                "held_out_rms": self.gap.held_out_rms,
            },
            "remainder": {
                "significant": self.remainder.significant,
                "description": self.remainder.description,
            },
            "rejected": [vars(rejected) for rejected in self.rejected],
            "next_experiment": None,
        }


def _effect_json(effect: Named) -> dict[str, Any]:
    return {
        "name": effect.name,
        "indistinguishable_from": effect.indistinguishable_from,
        "parameters": {
            name: {"value": e.value, "unit": e.unit, "ci95": list(e.ci95), "at_bound": e.at_bound}
            for name, e in effect.parameters.items()
        },
        "evidence": {
            "log10_bayes_factor": effect.log10_bayes_factor,
            "held_out": effect.held_out,
        },
    }
