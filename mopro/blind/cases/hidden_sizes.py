"""Total size of a hidden effect in the data, and the strength that gives a wanted size."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from mopro.blind.cases.foreign_kinds import ForeignKind
from mopro.blind.cases.hidden_effects import Drawn, Parameters
from mopro.blind.reference.motor import THESIS, Floats, Generator, Nominal
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument

# Effects with a smaller total size count as below the resolution of the experiment.
RESOLUTION_SIGMA = 8.0
# Total size in σ: from, below.
SIZE_CLASSES = {
    "below": (0.0, RESOLUTION_SIGMA),
    "faint": (RESOLUTION_SIGMA, 20.0),
    "clear": (20.0, 60.0),
    "strong": (60.0, 1000.0),
    "huge": (1000.0, math.inf),
}
# Tries, and how close in the logarithm is close enough: of an effect, and of something foreign.
_TRIES, _CLOSE_ENOUGH = 9, 0.08
_FOREIGN_TRIES, _FOREIGN_CLOSE_ENOUGH = 8, 0.1


def class_of(total_sigma: float) -> str:
    """The class of a total size."""
    return next(name for name, (_, high) in SIZE_CLASSES.items() if total_sigma < high)


class Plant(Protocol):
    """A machine with hidden effects; `stalled` once an axis has stalled."""

    @property
    def stalled(self) -> bool: ...

    def readings(
        self, run: ProgramRun, instruments: Sequence[Instrument], generator: Generator
    ) -> tuple[Floats, list[Floats]]:
        """Time stamps (s) and each instrument's readings (its unit), without noise."""
        ...


@dataclass
class NoiselessRuns:
    """Noiseless readings of the runs of a case, from which sizes are computed.

    `plant_of`: the plant with hidden effects, if it is not the reference plant.
    """

    runs: Sequence[ProgramRun]
    instruments: Sequence[Instrument]
    nominal: Nominal = THESIS
    plant_of: Callable[[dict[str, Parameters]], Plant] | None = None
    _plain: list[Floats] | None = field(default=None, init=False)

    def clean(self, plant: Plant) -> list[Floats]:
        """The readings of each run and instrument in turn, in the instrument's unit."""
        generator = np.random.default_rng(0)
        return [
            series
            for run in self.runs
            for series in plant.readings(run, self.instruments, generator)[1]
        ]

    def total_sigma(self, effects: dict[str, Parameters]) -> float:
        """Total size √(Σ (Δ - mean of Δ in the series)² / σ²); infinite if an axis stalls.

        Δ is the change of the readings. The mean of a sensor's offset alone is not subtracted.
        """
        change = self._change(effects, "sensor_offset")
        return math.inf if change is None else float(np.linalg.norm(change))

    def alone_sigma(self, effects: dict[str, Parameters]) -> dict[str, float]:
        """Size (σ) of the part of each effect's change that is orthogonal to the other effects."""
        shown = {
            name: self._change({name: values}, "sensor_offset") for name, values in effects.items()
        }
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

    def change(self, effects: dict[str, Parameters]) -> Floats | None:
        """Change of all readings in σ, each series less its mean; None if an axis stalls."""
        return self._change(effects)

    def _change(self, effects: dict[str, Parameters], whole_of: str = "") -> Floats | None:
        """The same; that of the effect `whole_of` alone with its mean."""
        plant = self._plant(effects)
        return self.change_of(plant, whole=set(effects) == {whole_of})

    def _plant(self, effects: dict[str, Parameters]) -> Plant:
        if self.plant_of is not None:
            return self.plant_of(effects)
        return ReferencePlant(effects, nominal=self.nominal)

    def change_of(self, plant: Plant, whole: bool = False) -> Floats | None:
        """Change of all readings in σ by all that is in `plant`; None if an axis stalls.

        Each series is less its mean, unless the `whole` change is asked for.
        """
        if self._plain is None:
            self._plain = self.clean(self._plant({}))
        shown = self.clean(plant)
        if plant.stalled:
            return None
        sigmas = [i.sigma for _ in self.runs for i in self.instruments]
        changes = []
        for series, plain, sigma in zip(shown, self._plain, sigmas, strict=True):
            change = (series - plain) / sigma
            changes.append(change - (0.0 if whole else change.mean()))
        return np.concatenate(changes)


def strength_for(
    noiseless: NoiselessRuns, name: str, drawn: Drawn, target: float, least: float
) -> tuple[float, float]:
    """The strength in [least, 1] whose total size is closest to `target`, and that size.

    A target of 0 or infinity stands for the near or the far end of the range; the far end is
    reduced until the axis does not stall.
    """
    if target in (0.0, math.inf):
        return _end_of_range(noiseless, name, drawn, least if target == 0.0 else 1.0)
    low, high = least, 1.0
    strength = min(max(0.2, least), 1.0)
    best = (least, math.inf)
    for _ in range(_TRIES):
        total = noiseless.total_sigma({name: drawn(strength)})
        if not math.isinf(total) and _log_error(total, target) <= _log_error(best[1], target):
            best = (strength, total)
        if _log_error(total, target) < _CLOSE_ENOUGH:
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


def _end_of_range(
    noiseless: NoiselessRuns, name: str, drawn: Drawn, strength: float
) -> tuple[float, float]:
    for _ in range(_TRIES):
        total = noiseless.total_sigma({name: drawn(strength)})
        if math.isfinite(total):
            break
        strength *= 0.7
    return strength, total


def _next(strength: float, total: float, target: float, low: float, high: float) -> float:
    """The next strength to try: in proportion if within (low, high), else bisection."""
    if total == 0.0:
        return high
    if math.isinf(total):
        return math.sqrt(low * high) if high > low else strength
    wanted = strength * target / total
    if low < wanted < high:
        return wanted
    edge = high if wanted >= high else low
    return edge if strength != edge and edge in (1.0, low) else math.sqrt(low * high)


def of_size(
    kind: ForeignKind, target: float, size_of: Callable[[Parameters], float], g: Generator
) -> tuple[Parameters, float]:
    """Numbers of about the `target` size (σ), and their size by `size_of`, if `sized`.

    The search takes steps in proportion; a strength that makes an axis stall is halved.
    """
    drawn = kind.draw(g, THESIS)
    if not kind.sized or kind.coloured:
        return drawn(1.0), 0.0
    strength, best = 0.2, (drawn(0.0), 0.0)
    for _ in range(_FOREIGN_TRIES):
        numbers = drawn(strength)
        size = size_of(numbers)
        if _log_error(size, target) < _log_error(best[1], target):
            best = numbers, size
        if _log_error(size, target) < _FOREIGN_CLOSE_ENOUGH:
            break
        step = target / max(size, 1e-9) if math.isfinite(size) else 0.5
        strength = min(strength * min(max(step, 0.02), 20.0), 1.0)
    return best


def _log_error(total: float, target: float) -> float:
    return abs(math.log(max(total, 1e-9) / target)) if math.isfinite(total) else math.inf
