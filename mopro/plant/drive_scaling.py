"""Factors on the drive's current and the motor's force constant over a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.effects import Active
from mopro.motion import Schedule
from mopro.plant.command_table import Floats, rows_along
from mopro.plant.repetition import Course

_HEAT_STEP_S = 5.0


@dataclass(frozen=True)
class DriveScaling:
    """Piecewise constant factors on the current (gain) and on the force constant.

    Each holds from its time on; the first time is 0.
    """

    times_s: Floats
    gain: Floats
    constant: Floats

    @classmethod
    def full(cls) -> DriveScaling:
        return cls(np.zeros(1), np.ones(1), np.ones(1))

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        """The two factors at each time (s)."""
        row = self.rows_at(time_s)
        return self.gain[row], self.constant[row]

    def rows_at(self, time_s: Floats) -> NDArray[np.intp]:
        """The row of the factors that hold at each time (s), and just after it."""
        return np.searchsorted(self.times_s, time_s, side="right") - 1

    def rows_along(self, time_s: Floats) -> NDArray[np.intp]:
        """As `rows_at`, for times that ascend: faster for many."""
        return rows_along(self.times_s, time_s)

    @property
    def course(self) -> Course:
        """The two factors over time."""
        return Course(self.times_s, np.column_stack([self.gain, self.constant]))

    @property
    def always_full(self) -> bool:
        return bool((self.gain == 1).all() and (self.constant == 1).all())

    def switched_off(self, time_s: float) -> DriveScaling:
        """These factors up to `time_s`, and no current after it."""
        before = self.times_s < time_s
        times = np.append(self.times_s[before], time_s)
        return DriveScaling(times, np.append(self.gain[before], 0.0), np.ones(len(times)))


def hold_scaling(schedule: Schedule, axis: int, active: Sequence[Active]) -> DriveScaling:
    """Factor on the current over time of an axis whose drive reduces it at rest."""
    holds = [h for a in active if (h := a.effect.hold(*a.values))]
    if not holds:
        return DriveScaling.full()
    after_s, share = holds[0]
    changes = [(0.0, 1.0)]
    rest_s = 0.0
    for move in [*[m for m in schedule.moves if axis in m.axes], None]:
        start_s = schedule.duration_s if move is None else move.start_s
        if start_s > rest_s + after_s:
            changes += [(rest_s + after_s, share), (start_s, 1.0 if move else share)]
        rest_s = start_s if move is None else move.end_s
    times, gain = map(np.array, zip(*changes, strict=True))
    return DriveScaling(times, gain, np.ones(len(times)))


def with_heat(
    scaling: DriveScaling,
    temperature_C: Callable[[Floats], Floats],
    duration_s: float,
    active: Sequence[Active],
) -> DriveScaling:
    """`scaling` with the force constant following the temperature, every few seconds."""
    by_heat = [a for a in active if a.effect.force_factor(np.zeros(1), *a.values) is not None]
    if not by_heat:
        return scaling
    times = np.union1d(scaling.times_s, np.arange(0.0, duration_s, _HEAT_STEP_S))
    constant: Floats = np.ones(len(times))
    for a in by_heat:
        factor = a.effect.force_factor(temperature_C(times), *a.values)
        constant = constant if factor is None else constant * factor
    return DriveScaling(times, scaling.at(times)[0], constant)
