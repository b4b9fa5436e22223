"""Data types of an experiment: a machine, its runs and the readings of their sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mopro.instruments.sensor import Sensor
from mopro.machine import Machine
from mopro.machine.run_effects import NO_DATA, Data
from mopro.program import Program
from mopro.source import Source, Span

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """Samples of one sensor in one run.

    `time_s` (n,) ascends, with zero at the first statement; `values` (n,) are in the unit of
    the sensor's column. Samples that the data file lacks are left out of both.
    """

    sensor: Sensor
    time_s: Floats
    values: Floats


@dataclass(frozen=True)
class LoggedCommand:
    """Commanded positions (m) of each axis at `time_s`, as a controller logged them."""

    time_s: Floats
    position_m: Mapping[int, Floats]


@dataclass(frozen=True)
class Trial:
    """One run of an experiment; `name` is its data file as the experiment names it.

    It has a program or a logged command, never both. `span` is the place of its data in
    the experiment file; data of a run that is `partial` may end before its program does.
    `data`: its file, and the checksum of what is in it.
    """

    name: str
    program: Program | None
    command: LoggedCommand | None
    payload_kg: float
    readings: tuple[Reading, ...]
    span: Span = field(default=Span(1, 1, 1), compare=False)
    partial: bool = False
    data: Data = NO_DATA

    @property
    def follows_motion(self) -> bool:
        """True if a sensor's quantity follows the motion, which must then be simulated."""
        return any(reading.sensor.quantity.follows_motion for reading in self.readings)

    @property
    def duration_s(self) -> float:
        """Time of the last sample of any reading (s)."""
        return max(float(reading.time_s[-1]) for reading in self.readings)


@dataclass(frozen=True)
class SteadyTable:
    """Final temperatures of steady motion back and forth, as in Tables 3.1 and 3.2.

    One element a row: the set velocity (m/s) and acceleration (m/s²) of each axis, the
    strokes along x and y (m) and the rise above the air (K). `noise_K` is the standard
    deviation of the rises, None where it is not known, `gain_tolerance` that of the thermometer.
    """

    name: str
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    x_m: Floats
    y_m: Floats
    rise_K: Floats
    noise_K: float | None
    gain_tolerance: float = 0.0


@dataclass(frozen=True)
class Experiment:
    """An experiment file and the data that it names.

    `notes` are remarks on the data that are not errors.
    """

    source: Source
    machine: Machine
    trials: tuple[Trial, ...]
    tables: tuple[SteadyTable, ...]
    notes: tuple[str, ...] = ()
