"""Machines drawn from the intervals that a machine file states of its numbers.

`mopro reconcile --out` writes `95 %: LOW to HIGH` into the `place` of what it fitted. A number is
drawn from the normal distribution about its value that has this interval, and kept within its
valid range. The file states no correlations, so each number is drawn by itself.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from mopro.errors import DataError
from mopro.sweeps.targets import (
    EffectTarget,
    MachineTarget,
    Value,
    Variant,
    VaryError,
    target_named,
)
from mopro.sweeps.varied import Varied

# A draw of a search, and those that verify what it found, are of different streams of a seed.
SEARCHED, VERIFIED = 0, 1
_NUMBER = r"[+-]?[0-9.]+(?:e[+-]?[0-9]+)?"
_INTERVAL = re.compile(rf"\b95 %: ({_NUMBER}) to ({_NUMBER})", re.ASCII)
_SIGMAS_OF_95 = 1.959964
_DRAWN_DIGITS = 8
# Times as many draws as show a share if none of them misses: some may.
_FEW_MISSED = 1.6


@dataclass(frozen=True)
class Uncertain:
    """A number of the machine that is known to `sigma`, both in the unit of `varied`.

    The only level of `varied` is the number as stated.
    """

    varied: Varied
    sigma: float

    def at(self, deviation: float) -> Value:
        """The number so many sigmas from the stated one, or the end of its valid range."""
        target, stated = self.varied.target, self.varied.levels[0]
        assert isinstance(target, MachineTarget | EffectTarget)
        factor = target.units[self.varied.unit]
        drawn = Fraction(f"{float(stated) + deviation * self.sigma:.{_DRAWN_DIGITS}g}")
        low, high = target.range
        if drawn * factor < low:
            return Fraction(low) / factor
        return Fraction(high) / factor if drawn * factor > high else drawn


@dataclass(frozen=True)
class Draws:
    """Number of machines to draw, the seed, and the share of figures that a band encloses.

    VaryError for fewer than one machine, and for a `band` beyond 0 to 1.
    """

    count: int
    seed: int = 0
    band: float = 0.9

    def __post_init__(self) -> None:
        if self.count < 1:
            raise VaryError(f"{self.count} draws: expected at least 1")
        if not 0 <= self.band <= 1:
            raise VaryError(f"a band of {self.band:g}: expected a share of the draws, 0 to 1")

    def enough_for(self, risk: float, confidence: float) -> Draws:
        """Draws with which one miss still shows a share below `risk` with this confidence."""
        needed = math.ceil(_FEW_MISSED * math.log(1 - confidence) / math.log1p(-risk))
        return replace(self, count=max(self.count, needed))

    def machines(
        self, numbers: Sequence[Uncertain], stream: int = SEARCHED
    ) -> list[tuple[Value, ...]]:
        """Values of `numbers`: as stated, then those of each machine drawn."""
        generator = np.random.default_rng([self.seed, stream])
        deviations = generator.standard_normal((self.count, len(numbers))).tolist()
        as_stated = [0.0] * len(numbers)
        return [
            tuple(number.at(d) for number, d in zip(numbers, own, strict=True))
            for own in (as_stated, *deviations)
        ]


def uncertain(base: Variant, varied: Sequence[Varied]) -> tuple[Uncertain, ...]:
    """The numbers of the machine that have an interval, without those that are `varied`.

    Numbers of an effect that belongs to certain runs have no part in a simulation. DataError where
    none is left.
    """
    taken: set[Hashable] = {place for each in varied for place in each.target.places}
    found = tuple(_stated(base, taken))
    if not found:
        raise DataError(
            f"{base.machine.name} states no interval of a number that could be drawn: expected "
            'place = "..., 95 %: LOW to HIGH", which `mopro reconcile --out` writes',
            "no-interval",
        )
    return found


def _stated(base: Variant, taken: Collection[Hashable]) -> Iterator[Uncertain]:
    for name, unit, value, (low, high) in _intervals(base):
        target = target_named(name, base.program, base.machine)
        if not target.places & set(taken) and high > low:
            varied = Varied(name, target, unit, (Fraction(str(value)),))
            yield Uncertain(varied, (high - low) / (2 * _SIGMAS_OF_95))


def _intervals(base: Variant) -> Iterator[tuple[str, str, float, tuple[float, float]]]:
    """Name, unit, value and interval of each number that states one."""
    source = base.machine.source
    stated: dict[str, Any] = tomllib.loads(source.text) if source else {}
    effects = stated.pop("effects", {})
    sections = [(key, own) for key, own in stated.items() if isinstance(own, dict)]
    sections += [
        (f"effects.{name}", own) for name, own in effects.items() if name not in base.machine.runs
    ]
    for section, numbers in sections:
        for key, number in numbers.items():
            place = number.get("place") if isinstance(number, dict) else None
            if isinstance(place, str) and (match := _INTERVAL.search(place)):
                ends = float(match[1]), float(match[2])
                yield f"{section}.{key}", number["unit"], number["value"], ends
