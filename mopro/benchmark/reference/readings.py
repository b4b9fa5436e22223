"""A run on the hidden plant: a program's text in, what each sensor shows out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mopro.benchmark.reference import disturbances, heat, plant, sensors
from mopro.benchmark.reference.listing import Timeline, timeline
from mopro.benchmark.reference.motion import Floats
from mopro.benchmark.reference.nominal import THESIS, Nominal
from mopro.benchmark.reference.plant import Hidden
from mopro.benchmark.reference.sensors import Instrument

# Sensors with play or a lag are followed this many times a sample, the motion itself at
# every fifth of them: between those a cubic with the right speeds is nanometres off.
_FINER, _EVERY = 20, 5
# A thermocouple is read every second at first, and then more rarely.
_EARLY_S, _LATE_STEP_S = 600.0, 15.0


@dataclass(frozen=True)
class Disturbance:
    """A disturbance off the catalogue; `size_m` multiplies its shape."""

    name: str
    numbers: Mapping[str, float]
    size_m: float


@dataclass(frozen=True)
class ProgramRun:
    """One run: a program, what is known to ride on the forcer, how long it is recorded.

    `until_s` ends a program that loops for ever.
    """

    text: str
    payload_kg: float = 0.0
    until_s: float | None = None


@dataclass
class ReferencePlant:
    """A machine with what is hidden in it; `stalled` once an axis lost its tooth."""

    hidden: Hidden
    disturbance: Disturbance | None = None
    nominal: Nominal = THESIS
    stalled: bool = field(default=False, init=False)

    def readings(
        self, trial: ProgramRun, instruments: Sequence[Instrument], generator: np.random.Generator
    ) -> tuple[Floats, list[Floats]]:
        """Time stamps (s) and, without noise, what each instrument shows in its unit.

        All instruments of a run share the first one's rate. The data last as long as
        the program does nominally.
        """
        until_s = 1e4 if trial.until_s is None else trial.until_s
        microstep_m = self.nominal.microstep_m
        expected = timeline(trial.text, until_s=until_s, microstep_m=microstep_m)
        real = timeline(trial.text, plant.controller(self.hidden), until_s, microstep_m)
        lasts = expected.duration_s if trial.until_s is None else trial.until_s
        if instruments[0].quantity == "temperature":
            stamps = thermocouple_times(lasts)
            return stamps, [self._warmth(real, stamps) for _ in instruments]
        rate_hz = instruments[0].rate_hz
        stamps = np.arange(math.floor(lasts * rate_hz + 1e-6) + 1) / rate_hz
        return stamps, [self._place(real, trial, i, stamps, generator) for i in instruments]

    def _warmth(self, real: Timeline, stamps: Floats) -> Floats:
        tau = sensors.lag_s("temperature", self.hidden)
        taken = np.maximum(sensors.sampled_at(stamps, self.hidden), 0.0)
        if not tau:
            return self._temperature(real, taken)
        dense = np.arange(0.0, float(taken[-1]) + 1.0, 0.25)
        seen = sensors.lagging(self._temperature(real, dense), 0.25, tau)
        return sensors.resampled(0.25, seen, taken)

    def _place(
        self,
        real: Timeline,
        trial: ProgramRun,
        instrument: Instrument,
        stamps: Floats,
        generator: np.random.Generator,
    ) -> Floats:
        taken = sensors.sampled_at(stamps, self.hidden)
        lag_s = sensors.lag_s("position", self.hidden)
        step_s = 1 / (instrument.rate_hz * _FINER)
        times = taken
        if lag_s or "backlash" in self.hidden:
            times = np.arange(math.ceil(max(taken[-1], 0.0) / step_s) + 2) * step_s
        dense = times is not taken
        own = self._motion(real, trial, instrument.axis, times, dense)
        other = np.zeros(len(times))
        if "cross_axis_coupling" in self.hidden:
            other = self._motion(real, trial, 3 - instrument.axis, times, dense)[:, 0]
        seen = sensors.transduced(own[:, 0], other, self._rise(real, times), self.hidden)
        if lag_s:
            seen = sensors.lagging(seen, step_s, lag_s)
        if dense:
            seen = sensors.resampled(step_s, seen, taken)
        seen = sensors.electronics(seen, taken, self.hidden)
        if self.disturbance:
            seen = seen + self.disturbance.size_m * disturbances.disturbance(
                self.disturbance.name,
                self.disturbance.numbers,
                stamps,
                own[:, 0],
                own[:, 2],
                generator,
            )
        return seen / instrument.unit

    def _motion(
        self, real: Timeline, trial: ProgramRun, axis: int, times: Floats, dense: bool
    ) -> Floats:
        if not dense:
            return self._axis(real, trial, axis, times)
        step_s = _EVERY * float(times[1] - times[0])
        coarse = np.arange(math.ceil(times[-1] / step_s) + 2) * step_s
        found = self._axis(real, trial, axis, coarse)
        place = CubicHermiteSpline(coarse, found[:, 0], found[:, 1])
        return np.column_stack([place(times), *(np.interp(times, coarse, c) for c in found.T[1:])])

    def _axis(self, real: Timeline, trial: ProgramRun, axis: int, times: Floats) -> Floats:
        def temperature(at_s: Floats) -> Floats:
            return self._temperature(real, at_s)

        pitch_m = self.nominal.pitch_m
        command = plant.rows(real, axis, self.hidden, temperature, pitch_m)
        numbers = plant.numbers(self.hidden, trial.payload_kg, self.nominal)
        found = plant.axis_response(times, command, numbers)
        self.stalled |= plant.lost_lock(found, self.hidden, pitch_m)
        return found

    def _rise(self, real: Timeline, times: Floats) -> Floats | float:
        if not self.hidden.get("platen_expansion", {}).get("share"):
            return 0.0
        return self._temperature(real, np.maximum(times, 0.0)) - self.nominal.air_C

    def _temperature(self, real: Timeline, at_s: Floats) -> Floats:
        return heat.temperature_C(real, at_s, self.hidden, self.nominal)


def thermocouple_times(lasts_s: float) -> Floats:
    """Every second at first, later every quarter of a minute."""
    early = np.arange(0.0, min(_EARLY_S, lasts_s) + 0.5)
    late = np.arange(_EARLY_S + _LATE_STEP_S, lasts_s + 0.5, _LATE_STEP_S)
    return np.concatenate((early, late))
