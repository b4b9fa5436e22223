"""Readings of a sensor in a run, and the models that predict them. Nothing here knows a motor."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.engine.tolerances import EXACT, Tolerances

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A value beyond this has run away. Its powers, and its slopes' squares, are finite.
RUN_AWAY = 1e60

# effect name -> parameter name -> value; an effect that is absent is off.
Settings = Mapping[str, Mapping[str, float]]


def unless_run_away(values: Floats) -> Floats:
    """`values`, NaN where they are not finite or have run away.

    What a simulation gives passes here before anything is worked out from it: of infinities
    numpy would warn, and of NaN follows NaN.
    """
    near = np.abs(values) < RUN_AWAY
    return values if near.all() else np.where(near, values, np.nan)


def key_of(settings: Settings) -> Hashable:
    """The settings as a key of what is kept about them, in whatever order they are stated."""
    return tuple(sorted((name, tuple(sorted(own.items()))) for name, own in settings.items()))


@dataclass(frozen=True)
class Series:
    """Readings of one sensor in one run.

    `values`: in `unit`. `sigma`: standard deviation of the noise in `unit`, or None where it
    is unknown and is estimated. `time_s` and `folds` have the length of `values`; `folds`
    numbers the parts of the run (moves) that can be held out, alike in all its series.
    `nuisances` (samples x shapes): shapes that are always fitted and never an effect; a
    constant offset unless given. `labels`: further arrays of that length (`position` in
    `position_unit`, `velocity`, `acceleration`, `temperature`) used to describe an unexplained
    residual; what was commanded, or measured by another sensor. `of_place`: its values are
    positions, so that a prediction of them tells the place and the speed better than labels.
    `tolerances`: how exact the sensor is stated to be; what they allow is fitted with every set of
    effects, alike in all series of the sensor. `fed_back`: an input of the model was computed from
    these readings by a closed loop, so that a term in the prediction would explain the readings by
    themselves. `wild` (samples): those that do not count. `path`: times (s) and places of the
    motion at all rows of the run, also where there is no reading, in `position_unit`. `of_inputs`
    (samples x terms): what the noise of the model's inputs may come to, in `unit`, as terms of a
    normal prior of width 1, which all series of the run share. `record`: what the run is a part of;
    runs of one record share its accidents and are held out together. "" for the run itself.
    `count`: the step of its converter in `position_unit`; no line in position has a period below
    two of them.
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
    of_place: bool = False
    fed_back: bool = False
    wild: Mask | None = None
    path: tuple[Floats, Floats] | None = None
    tolerances: Tolerances = EXACT
    of_inputs: Floats | None = None
    record: str = ""
    count: float = 0.0

    def __len__(self) -> int:
        return len(self.values)

    @property
    def exact(self) -> bool:
        """True if all that it has beyond the model and the nuisances is white noise."""
        return not self.tolerances and self.of_inputs is None

    @property
    def counted(self) -> Mask:
        """The samples that count."""
        return np.ones(len(self), dtype=bool) if self.wild is None else ~self.wild

    def nuisance_shapes(self) -> Floats:
        """The nuisances (samples x shapes), 0 at samples that do not count."""
        shapes = np.ones((len(self), 1)) if self.nuisances is None else self.nuisances
        return shapes if self.wild is None else shapes * self.counted[:, None]

    def without_nuisances(self, residual: Floats) -> Floats:
        """A residual of this series (samples, in its unit) less the nuisances fitted to it.

        0 at samples that do not count.
        """
        residual, shapes = residual * self.counted, self.nuisance_shapes()
        if not shapes.shape[1]:
            return residual
        left: Floats = residual - shapes @ np.linalg.lstsq(shapes, residual, rcond=None)[0]
        return left


class Simulate(Protocol):
    """Predict each series, in their order, lengths and units, with the effects in `settings`.

    Must be deterministic, and safe to call from several threads at once if `reconcile`
    is given more than one job.
    """

    def __call__(self, settings: Settings) -> Sequence[Floats]: ...
