"""Measured runs of a stated machine: signals, sensors and their samples, in SI inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mopro.engine.residuals import least_noise, wild_samples
from mopro.engine.tolerances import EXACT, Tolerances
from mopro.formula import Dimension
from mopro.formula.evaluate import Floats
from mopro.formula.written import Written
from mopro.instruments.quantity import Measurable
from mopro.machine.run_effects import NO_DATA, Data
from mopro.source import Source
from mopro.stated.model import THERMAL, StatedMachine
from mopro.tomlfile import Value

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Sensor:
    """A sensor: a reading is `sign` * `scale` * what it `reads` + an offset, in `unit`.

    `noise_rms` is None where it is unknown. `scale`, `sign` and `zero` are None where they are
    free; a drift is None (there is none), 0 (straight) or the time (s) after which it may bend.
    `step`: that of its converter, which is in `noise_rms` as well. `tolerances`: in `unit`.
    """

    name: str
    quantity: Measurable
    column: str
    unit: str
    factor: float
    dimension: Dimension
    noise_rms: float | None
    reads: Written
    zero: float | None = None
    drift_s: float | None = None
    scale: float | None = 1.0
    sign: int | None = 1
    step: float = 0.0
    value: Value | None = field(default=None, compare=False)
    tolerances: Tolerances = EXACT


@dataclass(frozen=True)
class Reading:
    """Samples of one sensor: `values` (n,) in its unit, at the rows `rows` (n,) of the run.

    `opening`: what the whole record begins with, where these are some of its samples.
    """

    sensor: Sensor
    rows: Indices
    values: Floats
    opening: float | None = None

    @cached_property
    def first(self) -> float:
        """The first value or, if that is wild, where lines through the next ones lead back to.

        The median of three, as one of those may be wild as well.
        """
        if self.opening is not None:
            return self.opening
        if not self.first_is_wild:
            return float(self.values[0])
        return float(np.median(2 * self.values[1:4] - self.values[2:7:2]))

    @cached_property
    def first_is_wild(self) -> bool:
        """True if the first value stands apart from the next ones by more than noise allows."""
        least = least_noise(self.values, self.sensor.noise_rms)
        return bool(wild_samples(self.values, least)[0])


@dataclass(frozen=True)
class Run:
    """One run: the time (s) and inputs (SI) of each row, and what was measured.

    `start`: values of states at the first row, None where they are free; a state that is not in it
    begins as the first that is. `without`: effects that are known to be off. `feedback`: an input
    was made from the readings, by a closed loop, so that a dependence of the readings on it tells
    nothing of the machine. `noise`: stated standard deviation (SI) of inputs' measurement.
    `data`: its file, and the checksum of what is in it. `headings`: the columns of the log that
    time (`t`) and inputs are, each with its unit in SI.
    """

    name: str
    time_s: Floats
    inputs: Mapping[str, Floats]
    held: frozenset[str]
    readings: tuple[Reading, ...]
    start: Mapping[str, float | None]
    without: frozenset[str] = frozenset()
    feedback: bool = False
    noise: Mapping[str, float] = field(default_factory=dict)
    data: Data = NO_DATA
    headings: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    value: Value | None = field(default=None, compare=False)

    @property
    def record(self) -> str:
        """What it is a part of: runs of the same data, such as two halves of a log, share it."""
        return self.data[1] or self.name


@dataclass(frozen=True)
class StatedExperiment:
    """An experiment on a stated machine; `dimensions` are those of the inputs.

    `units` are the units of the inputs, by name. `notes` are remarks on the data.
    """

    source: Source
    machine: StatedMachine
    trials: tuple[Run, ...]
    units: Mapping[str, str]
    notes: tuple[str, ...] = ()
    columns: tuple[Mapping[str, Floats], ...] = ()

    @cached_property
    def begins_in_balance(self) -> bool:
        """True if each node begins as warm as its surroundings, at what its sensor shows first.

        Where the zeros of the sensors are free: what they show apart then is their zeros, and no
        heat flows between the nodes.
        """
        if self.machine.kind != THERMAL or "ambient" in self.units:
            return False
        shown = [
            (reading, run.start[node])
            for run in self.trials
            for reading in run.readings
            for node in reading.sensor.reads.formula.names & run.start.keys()
        ]
        return all(r.sensor.zero is None and start == r.first for r, start in shown)
