"""What the engine is given: a model that can be run, candidates, and measured series.

Nothing here knows a motor. A model is any function that predicts what each sensor would
have shown in a run, for given parameters of given effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# effect name -> parameter name -> value; an effect that is absent is off.
Settings = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, within its plausible range [`low`, `high`].

    An `amplitude` is 0 where the effect is off, and the response is nearly proportional
    to it when it is small; the others (a period, a phase) shape what it multiplies and
    are tried at each of `starts`.
    """

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]
    amplitude: bool = True


@dataclass(frozen=True)
class Candidate:
    """An effect that the model may lack.

    A rough response (steps) has `smooth` false; a `flexible` one (a free period) can
    mimic much that is in no catalogue, and is believed only if it leaves nothing.
    """

    name: str
    parameters: tuple[Parameter, ...]
    smooth: bool = True
    flexible: bool = False


@dataclass(frozen=True)
class Series:
    """What one sensor showed in one run.

    `sigma` is its noise (standard deviation, in `unit`), or None where it is unknown and
    the fit must tell. `time_s` and `folds` have the values' length: folds number the
    parts (moves) that can be held out. `nuisances` (length x count) are shapes that
    nobody would call an effect, fitted always; a constant offset unless given.
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

    def __len__(self) -> int:
        return len(self.values)

    def nuisance_shapes(self) -> Floats:
        return np.ones((len(self), 1)) if self.nuisances is None else self.nuisances


class Simulate(Protocol):
    """Predict each series, in their order and of their lengths, with effects as set."""

    def __call__(self, settings: Settings) -> Sequence[Floats]: ...
