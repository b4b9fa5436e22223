"""What an experiment is: a machine, its runs, and what each sensor showed in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.emulator.measured import Sensor
from mopro.machine import Machine
from mopro.program import Program
from mopro.source import Source

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """What one sensor showed in one run.

    `time_s` ascends from the first statement on; `values` have its length and the unit of
    the sensor's column. Both leave out the samples that the data file lacks.
    """

    sensor: Sensor
    time_s: Floats
    values: Floats


@dataclass(frozen=True)
class LoggedCommand:
    """Where a controller told each axis to be: the positions (m) of each at `time_s`."""

    time_s: Floats
    position_m: Mapping[int, Floats]


@dataclass(frozen=True)
class Trial:
    """One run of an experiment; `name` is its data file as the experiment names it.

    It has a program or a logged command, never both.
    """

    name: str
    program: Program | None
    command: LoggedCommand | None
    payload_kg: float
    readings: tuple[Reading, ...]

    @property
    def duration_s(self) -> float:
        """How far its data go."""
        return max(float(reading.time_s[-1]) for reading in self.readings)


@dataclass(frozen=True)
class SteadyTable:
    """Final temperatures of steady motion back and forth, as Tables 3.1 and 3.2 have them.

    One element a row: the set velocity (m/s) and acceleration (m/s²) of each axis, the
    strokes along x and y (m) and the rise above the air (K). `noise_K` is the standard
    deviation of the rises, None where it is not known.
    """

    name: str
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    x_m: Floats
    y_m: Floats
    rise_K: Floats
    noise_K: float | None


@dataclass(frozen=True)
class Experiment:
    """An experiment file with all that it names read."""

    source: Source
    machine: Machine
    trials: tuple[Trial, ...]
    tables: tuple[SteadyTable, ...]
