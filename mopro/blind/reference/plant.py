"""Readings of each sensor (without noise) in a run of the reference plant under a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mopro.blind.reference import axis as motion
from mopro.blind.reference import heat, sensors, uncatalogued
from mopro.blind.reference.listing import Timeline, timeline
from mopro.blind.reference.motor import THESIS, Floats, Generator, Hidden, Nominal
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Disturbance, Foreign

# Sensors with play or a lag are computed at this many times per sample, the motion at every
# fifth of these: between them, Hermite interpolation is accurate to nanometres.
_OVERSAMPLING, _MOTION_EVERY = 20, 5
# A thermocouple is read every second at first, then at longer intervals.
_EARLY_S, _LATE_STEP_S = 600.0, 15.0


@dataclass(frozen=True)
class ProgramRun:
    """One run: the text of a program, the known payload and the time of recording.

    `until_s` ends a program that loops for ever.
    """

    text: str
    payload_kg: float = 0.0
    until_s: float | None = None


@dataclass
class ReferencePlant:
    """A machine with hidden effects and something foreign; `stalled` once an axis stalls."""

    hidden: Hidden
    disturbance: Disturbance | None = None
    nominal: Nominal = THESIS
    foreign: Foreign | None = None
    stalled: bool = field(default=False, init=False)

    def readings(
        self, run: ProgramRun, instruments: Sequence[Instrument], generator: Generator
    ) -> tuple[Floats, list[Floats]]:
        """Time stamps (s, shape (n,)) and each instrument's readings (its unit, shape (n,)).

        All instruments have the rate of the first. The recording lasts as long as the
        program would without hidden effects. Noise is added by `sensors.stored`.
        """
        until_s = 1e4 if run.until_s is None else run.until_s
        microstep_m = self.nominal.microstep_m
        expected = timeline(run.text, until_s=until_s, microstep_m=microstep_m)
        real = timeline(run.text, motion.controller(self.hidden), until_s, microstep_m)
        lasts = expected.duration_s if run.until_s is None else run.until_s
        if instruments[0].quantity == "temperature":
            stamps = thermocouple_times(lasts)
            return stamps, [self._temperature_readings(real, stamps) for _ in instruments]
        rate_hz = instruments[0].rate_hz
        stamps = np.arange(math.floor(lasts * rate_hz + 1e-6) + 1) / rate_hz
        return stamps, [
            self._position_readings(real, run, i, stamps, generator) for i in instruments
        ]

    def _temperature_readings(self, real: Timeline, stamps: Floats) -> Floats:
        tau = sensors.lag_s("temperature", self.hidden)
        taken = np.maximum(sensors.sampled_at(stamps, self.hidden), 0.0)
        if not tau:
            return self._temperature(real, taken)
        dense = np.arange(0.0, float(taken[-1]) + 1.0, 0.25)
        seen = sensors.low_pass(self._temperature(real, dense), 0.25, tau)
        return sensors.resampled(0.25, seen, taken)

    def _position_readings(
        self,
        real: Timeline,
        run: ProgramRun,
        instrument: Instrument,
        stamps: Floats,
        generator: Generator,
    ) -> Floats:
        taken = uncatalogued.clock(sensors.sampled_at(stamps, self.hidden), self.foreign, generator)
        lag_s = sensors.lag_s("position", self.hidden)
        step_s = 1 / (instrument.rate_hz * _OVERSAMPLING)
        times = taken
        if lag_s or "backlash" in self.hidden:
            times = np.arange(math.ceil(max(taken[-1], 0.0) / step_s) + 2) * step_s
        dense = times is not taken
        own = self._motion(real, run, instrument.axis, times, dense)
        other = np.zeros(len(times))
        if "cross_axis_coupling" in self.hidden:
            other = self._motion(real, run, 3 - instrument.axis, times, dense)[:, 0]
        seen = sensors.transduced(own[:, 0], other, self._rise_K(real, times), self.hidden)
        if lag_s:
            seen = sensors.low_pass(seen, step_s, lag_s)
        if dense:
            seen = sensors.resampled(step_s, seen, taken)
        seen = sensors.with_hum(seen, taken, self.hidden)
        seen = uncatalogued.signal(
            seen, stamps, self._bowing_K(real, stamps), self.foreign, generator
        )
        if self.disturbance:
            seen = seen + self.disturbance.size_m * uncatalogued.disturbance(
                self.disturbance.name,
                self.disturbance.numbers,
                stamps,
                own[:, 0],
                own[:, 2],
                generator,
            )
        return seen / instrument.unit

    def _motion(
        self, real: Timeline, run: ProgramRun, axis: int, times: Floats, dense: bool
    ) -> Floats:
        if not dense:
            return self._axis(real, run, axis, times)
        step_s = _MOTION_EVERY * float(times[1] - times[0])
        coarse = np.arange(math.ceil(times[-1] / step_s) + 2) * step_s
        found = self._axis(real, run, axis, coarse)
        place = CubicHermiteSpline(coarse, found[:, 0], found[:, 1])
        return np.column_stack([place(times), *(np.interp(times, coarse, c) for c in found.T[1:])])

    def _axis(self, real: Timeline, run: ProgramRun, axis: int, times: Floats) -> Floats:
        def temperature(at_s: Floats) -> Floats:
            return self._temperature(real, at_s)

        pitch_m = self.nominal.pitch_m
        command = motion.rows(real, axis, self.hidden, temperature, pitch_m)
        command = uncatalogued.with_lost_microsteps(command, self.foreign, self.nominal.microstep_m)
        numbers = motion.numbers(self.hidden, run.payload_kg, self.nominal, self.foreign)
        found = motion.axis_response(times, command, numbers)
        self.stalled |= motion.has_stalled(found, self.hidden, pitch_m)
        return found

    def _rise_K(self, real: Timeline, times: Floats) -> Floats | float:
        if not self.hidden.get("platen_expansion", {}).get("share"):
            return 0.0
        return self._temperature(real, np.maximum(times, 0.0)) - self.nominal.air_C

    def _bowing_K(self, real: Timeline, stamps: Floats) -> Floats | None:
        """The rise of the temperature if it matters to what is foreign; else None."""
        if self.foreign is None or self.foreign.name != "thermal_bow":
            return None
        return self._temperature(real, stamps) - self.nominal.air_C

    def _temperature(self, real: Timeline, at_s: Floats) -> Floats:
        return heat.temperature_C(real, at_s, self.hidden, self.nominal)


def thermocouple_times(lasts_s: float) -> Floats:
    """Time stamps (s): every second for ten minutes, then every 15 s."""
    early = np.arange(0.0, min(_EARLY_S, lasts_s) + 0.5)
    late = np.arange(_EARLY_S + _LATE_STEP_S, lasts_s + 0.5, _LATE_STEP_S)
    return np.concatenate((early, late))
