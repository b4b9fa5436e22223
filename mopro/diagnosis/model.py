"""What the engine is given: a model that can be run, candidates, and measured series.

Nothing here knows a motor. A model is any function that predicts what each sensor would
have shown in a run, for given parameters of given effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

# What the ends of a plausible range are uncertain by, as a share of it.
_ROUND = 0.01

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# effect name -> parameter name -> value; an effect that is absent is off.
Settings = Mapping[str, Mapping[str, float]]


class Role(StrEnum):
    """How the response follows a parameter.

    An AMPLITUDE has a value (`null`) at which the effect is off, and the response grows
    nearly in proportion from there. A SHAPE (a period, a corner) decides the form of what
    the amplitudes multiply. A PHASE is an angle in radians: the response at any is a sum
    of those at 0 and at π/2. A HELD one is found by the candidate's own search, and least
    squares leaves it alone (a count, the moment of a step).
    """

    AMPLITUDE = "amplitude"
    SHAPE = "shape"
    PHASE = "phase"
    HELD = "held"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, fitted within [`low`, `high`].

    `starts` are the values to try it at. `plausible` is the range to expect it in, the
    whole one unless given: a value clearly outside of it speaks against the effect.
    A value in `tolerated` merely corrects a number that the model itself states no better:
    that is a calibration, and no finding.
    `inverse` fits one over the value (a corner frequency, a period), and `difference` is
    the share of the range that finite differences take: small against what the response
    can follow evenly, large against the rounding of a simulation.
    """

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...] = ()
    role: Role = Role.AMPLITUDE
    null: float = 0.0
    plausible: tuple[float, float] | None = None
    inverse: bool = False
    difference: float = 1e-3
    tolerated: tuple[float, float] | None = None

    def scaled(self, value: float) -> float:
        """`value` as a share of the range, 0 to 1."""
        low, high = self._coordinate(self.low), self._coordinate(self.high)
        return (self._coordinate(value) - low) / (high - low)

    def value(self, scaled: float) -> float:
        """What `scaled` gives."""
        low, high = self._coordinate(self.low), self._coordinate(self.high)
        return self._coordinate(low + scaled * (high - low))

    def grown(self, value: float, size: float) -> float:
        """The value whose distance from the null is `size` times that of `value`."""
        null = self._coordinate(self.null)
        coordinate = null + size * (self._coordinate(value) - null)
        if self.inverse and coordinate <= 0:
            return max(self.low, self.high)
        return self._coordinate(coordinate)

    def size(self, value: float, of: float) -> float:
        """How many times as far from the null `value` is as `of`."""
        null = self._coordinate(self.null)
        return (self._coordinate(value) - null) / (self._coordinate(of) - null)

    def _coordinate(self, value: float) -> float:
        return 1 / value if self.inverse else value

    def beyond(self, value: float) -> float:
        """By how much `value` is outside the plausible range; 0 inside.

        Its ends are round numbers, and what is a little past one is no news.
        """
        low, high = self.plausible or (self.low, self.high)
        margin = _ROUND * (high - low)
        return max(low - margin - value, value - margin - high, 0.0)

    def tolerates(self, value: float, error: float) -> bool:
        """Whether `value`, known to within `error`, is in the model's tolerance."""
        if self.tolerated is None or not math.isfinite(error):
            return False
        low, high = self.tolerated
        return low - error <= value <= high + error

    def within(self, value: float) -> float:
        """The nearest value in the range; an angle is turned into ±π first."""
        if self.role is Role.PHASE:
            value = math.remainder(value, 2 * math.pi)
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Leftover:
    """What a candidate's own search is shown: the data, and what a fit leaves of them.

    `residuals` are one array a series, in standard deviations, which are `sigmas` in the
    series' units; `predictions` are what the model says there, with the `settings` that are
    fitted already. `misfit(settings)` is the sum of squares that the whole residual would
    have with further ones.
    """

    data: Sequence[Series]
    residuals: Sequence[Floats]
    sigmas: Sequence[float]
    predictions: Sequence[Floats]
    settings: Settings
    misfit: Callable[[Settings], float]


Seek = Callable[[Leftover], Iterable[Mapping[str, float]]]


@dataclass(frozen=True)
class Candidate:
    """An effect that the model may lack.

    Where honest people write an effect differently there are several `form`s of one name,
    of which the evidence picks one; `fixed` are the parameters that a form does not fit.
    A form that `refines` another (by its form) frees more of it, and is tried only when
    that one has been found, unless it may come `by_itself`. A `flexible` effect (a free
    period) can mimic much that is in no catalogue, and is believed only if it leaves nothing.
    `seek` looks for starts in what is left over, where a few fixed ones cannot find it.
    """

    name: str
    parameters: tuple[Parameter, ...]
    form: str = ""
    fixed: Mapping[str, float] = field(default_factory=dict)
    refines: str | None = None
    by_itself: bool = False
    flexible: bool = False
    seek: Seek | None = None

    @property
    def key(self) -> tuple[str, str]:
        return self.name, self.form

    def frees_more_than(self, other: Candidate) -> bool:
        """Whether it is the effect `other` with parameters fitted that are fixed there."""
        own, others = ({p.name for p in c.parameters} for c in (self, other))
        kept = {name: value for name, value in other.fixed.items() if name not in own}
        return self.name == other.name and others < own and kept == dict(self.fixed)

    @property
    def calibrates(self) -> bool:
        """Whether it may be no more than the correction of a number that has a tolerance."""
        return any(parameter.tolerated for parameter in self.parameters)

    def settings(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {self.name: {**self.fixed, **values}}


@dataclass(frozen=True)
class Series:
    """What one sensor showed in one run.

    `sigma` is its noise (standard deviation, in `unit`), or None where it is unknown and
    the fit must tell. `time_s` and `folds` have the values' length: folds number the
    parts (moves) of the run that can be held out, the same in all its series. `nuisances`
    (length x count) are shapes that nobody would call an effect, fitted always; a constant
    offset unless given. `labels` are further arrays of that length (`position` in
    `position_unit`, `velocity`, `acceleration`) that help to describe what no effect
    accounts for.
    """

    run: str
    sensor: str
    unit: str
    values: Floats
    sigma: float | None
    time_s: Floats | None = None
    folds: NDArray[np.int64] | None = None
    nuisances: Floats | None = None
    labels: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    position_unit: str = "m"

    def __len__(self) -> int:
        return len(self.values)

    def nuisance_shapes(self) -> Floats:
        return np.ones((len(self), 1)) if self.nuisances is None else self.nuisances


class Simulate(Protocol):
    """Predict each series, in their order and of their lengths, with effects as set.

    Must be deterministic, and safe to call from several threads at once if `reconcile`
    is given more than one job.
    """

    def __call__(self, settings: Settings) -> Sequence[Floats]: ...
