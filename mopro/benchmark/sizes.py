"""How large a hidden effect shows, and the strength at which it shows as large as wanted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mopro.benchmark.hidden import Drawn
from mopro.benchmark.reference.experiment import Plant, Trial
from mopro.benchmark.reference.motion import Floats
from mopro.benchmark.reference.nominal import THESIS, Nominal
from mopro.benchmark.reference.sensors import Instrument

BELOW = 8.0
# name -> from, below (σ in total)
CLASSES = {
    "below": (0.0, BELOW), "faint": (BELOW, 20.0), "clear": (20.0, 60.0), "strong": (60.0, 1000.0),
    "huge": (1000.0, math.inf),
}  # fmt: skip
_TRIES = 9
_NEAR = 0.08


def class_of(total_sigma: float) -> str:
    """The class of a total size."""
    return next(name for name, (_, high) in CLASSES.items() if total_sigma < high)


@dataclass
class Bench:
    """Runs of a machine and their instruments, against which sizes are measured."""

    trials: Sequence[Trial]
    instruments: Sequence[Instrument]
    nominal: Nominal = THESIS
    _plain: list[Floats] | None = field(default=None, init=False)

    def clean(self, plant: Plant) -> list[Floats]:
        """What all instruments show in all runs, without noise, in their units."""
        generator = np.random.default_rng(0)
        return [
            series
            for trial in self.trials
            for series in plant.readings(trial, self.instruments, generator)[1]
        ]

    def total_sigma(self, effects: dict[str, dict[str, float]]) -> float:
        """sqrt(Σ (Δ - its mean in the series)² / σ²); infinite where an axis stalls.

        A sensor's offset alone is measured whole: nothing of it would be left.
        """
        change = self._change(effects)
        return math.inf if change is None else float(np.linalg.norm(change))

    def alone_sigma(self, effects: dict[str, dict[str, float]]) -> dict[str, float]:
        """The size of what each effect shows that the others together cannot mimic."""
        shown = {name: self._change({name: values}) for name, values in effects.items()}
        found = {}
        for name, own in shown.items():
            others = [c for other, c in shown.items() if other != name and c is not None]
            if own is None or not others:
                found[name] = math.inf if own is None else float(np.linalg.norm(own))
                continue
            basis = np.column_stack(others)
            share = np.linalg.lstsq(basis, own, rcond=None)[0]
            found[name] = float(np.linalg.norm(own - basis @ share))
        return found

    def _change(self, effects: dict[str, dict[str, float]]) -> Floats | None:
        """What the effects change, in σ, each series less its mean; None for a stall."""
        if self._plain is None:
            self._plain = self.clean(Plant({}, nominal=self.nominal))
        plant = Plant(effects, nominal=self.nominal)
        shown = self.clean(plant)
        if plant.stalled:
            return None
        whole = set(effects) == {"sensor_offset"}
        sigmas = [i.sigma for _ in self.trials for i in self.instruments]
        changes = []
        for series, plain, sigma in zip(shown, self._plain, sigmas, strict=True):
            change = (series - plain) / sigma
            changes.append(change - (0.0 if whole else change.mean()))
        return np.concatenate(changes)


def strength_for(
    bench: Bench, name: str, drawn: Drawn, target: float, least: float
) -> tuple[float, float]:
    """The strength in [least, 1] whose total is nearest to `target`, and that total.

    A target of 0 or infinity stands for the near and the far end of the range; the far
    one is drawn in where the axis would stall.
    """
    if target in (0.0, math.inf):
        return _end(bench, name, drawn, least if target == 0.0 else 1.0)
    low, high = least, 1.0
    strength = min(max(0.2, least), 1.0)
    best = (least, math.inf)
    for _ in range(_TRIES):
        total = bench.total_sigma({name: drawn(strength)})
        if not math.isinf(total) and _off(total, target) <= _off(best[1], target):
            best = (strength, total)
        if _off(total, target) < _NEAR:
            break
        if total > target:
            high = strength
        else:
            low = strength
        wanted = _next(strength, total, target, low, high)
        if wanted == strength:
            break
        strength = wanted
    return best


def _end(bench: Bench, name: str, drawn: Drawn, strength: float) -> tuple[float, float]:
    for _ in range(_TRIES):
        total = bench.total_sigma({name: drawn(strength)})
        if math.isfinite(total):
            break
        strength *= 0.7
    return strength, total


def _next(strength: float, total: float, target: float, low: float, high: float) -> float:
    """In proportion where that stays between what is known, else the middle."""
    if total == 0.0:
        return high
    if math.isinf(total):
        return math.sqrt(low * high) if high > low else strength
    wanted = strength * target / total
    if low < wanted < high:
        return wanted
    edge = high if wanted >= high else low
    return edge if strength != edge and edge in (1.0, low) else math.sqrt(low * high)


def _off(total: float, target: float) -> float:
    return abs(math.log(max(total, 1e-9) / target)) if math.isfinite(total) else math.inf
