"""Readings of a sensor for a run: the recording is the true motion, this is the measurement.

Effects of the measurement act here, in the order of the chain: where the target really
is (geometry), what the transducer makes of it (reading), how slowly it follows
(bandwidth), when samples are taken, what the electronics add; then noise and the
converter's step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
from scipy.linalg import blas

from mopro.effects import Active, on_axis
from mopro.effects.effect import Scene
from mopro.instruments.sensor import Sensor
from mopro.machine import Machine
from mopro.plant.command_table import Floats, hermite
from mopro.program import AXES
from mopro.recording import Recording
from mopro.recording.record import Columns


def first_order(interval_s: float, x: Floats, lag_s: float) -> Floats:
    """Response to evenly sampled `x` with the time constant `lag_s` (s), from rest at its start.

    y' = (x - y)/lag, exact for what is linear or a parabola over the samples.
    """
    decay = math.exp(-interval_s / lag_s)
    mean = lag_s / interval_s * (1 - decay)
    new, old = 1 - mean, mean - decay
    # What a parabola adds between two samples, for each unit of its second difference.
    bend = lag_s / interval_s * ((lag_s / interval_s + 0.5) * (1 - decay) - 1)
    second = np.pad(np.diff(x, 2), 1, "edge") if len(x) > 2 else np.zeros(len(x))
    means = np.concatenate(([0.0], (second[1:] + second[:-1]) / 2))
    driven = new * x + old * np.concatenate((x[:1], x[:-1])) + bend * means
    driven[0] = x[0]
    # Each value less `decay` times the one before is what drives it: a banded triangular system.
    # scipy.signal would solve it too, and takes a third of a second to import.
    bands = np.array([np.ones(len(x)), np.full(len(x), -decay)], order="F")
    return cast(Floats, blas.dtbsv(1, bands, driven, lower=1, diag=1, overwrite_x=1))


# Share of the interval of samples within which a stamp is on one: more than the rounding of times
# of an hour, and at 10 m/s less than a nanometre. Halved or doubled, no reading changes.
_ON_A_SAMPLE = 1e-7


def measure(
    recording: Recording,
    sensor: Sensor,
    machine: Machine,
    active: Sequence[Active] = (),
    generator: np.random.Generator | None = None,
) -> tuple[Floats, Floats]:
    """The sensor's time stamps (s) and readings (in its column's unit).

    Noise needs a `generator`. Before and after the recording everything stands still.
    """
    end_s = float(recording["time_s"][-1])
    stamps = np.arange(math.floor(end_s * sensor.rate_hz + 1e-6) + 1) / sensor.rate_hz
    seen = measured_at(recording.columns, sensor, machine, active, stamps)
    return stamps, _converted(seen, sensor, generator)


def measured_at(
    columns: Columns,
    sensor: Sensor,
    machine: Machine,
    active: Sequence[Active],
    stamps: Floats,
) -> Floats:
    """The reading for each stamp (s), in the column's unit; no noise, no converter's step.

    `columns` are those of a recording, evenly sampled from 0 on; for a sensor that does not
    see the forcer's place `time_s` and the column of its quantity will do.
    """
    chain = tuple(active)
    if sensor.quantity.of_axis:
        chain = on_axis(chain, sensor.axis)
    dense = columns["time_s"]
    seen = _target(columns, sensor, machine, chain)
    for a in chain:
        lag_s = a.effect.bandwidth_s(sensor.quantity, *a.values)
        seen = first_order(float(dense[1]), seen, lag_s) if lag_s > 0 else seen
    taken = stamps
    for a in chain:
        taken = a.effect.sampled_at(taken, *a.values)
    reading = interpolated(dense, seen, taken)
    if sensor.quantity.sees_place:
        for a in chain:
            reading = a.effect.electronics(reading, taken, *a.values)
    return reading / sensor.unit_si


def _target(columns: Columns, sensor: Sensor, machine: Machine, chain: Sequence[Active]) -> Floats:
    x: Floats = columns[sensor.recorded_column]
    if not sensor.quantity.sees_place:
        return x
    others = [n for n in AXES if n != sensor.axis and f"position_{n}_m" in columns]
    scene = Scene(
        time_s=columns["time_s"],
        other_m=columns[f"position_{others[0]}_m"] if others else np.zeros_like(x),
        temperature_C=columns["temperature_C"],
        air_C=machine.heat.ambient_C,
    )
    for a in chain:
        x = a.effect.geometry(x, scene, *a.values)
    for a in chain:
        x = a.effect.reading(x, scene, *a.values)
    return x


def interpolated(time_s: Floats, values: Floats, at_s: Floats) -> Floats:
    """`values` between evenly spaced samples, by a cubic with central slopes."""
    if len(time_s) < 2:
        return np.full(len(at_s), float(values[0]))
    h = float(time_s[1] - time_s[0])
    place = np.clip(at_s / h, 0.0, len(time_s) - 1)
    nearest = np.rint(place)
    if np.abs(place - nearest).max(initial=0.0) < _ON_A_SAMPLE:
        return values[nearest.astype(np.intp)]
    i = np.minimum(place.astype(np.int64), len(time_s) - 2)
    u = place - i
    slope = np.gradient(values)
    return hermite(u, values[i], values[i + 1], slope[i], slope[i + 1])


def _converted(reading: Floats, sensor: Sensor, generator: np.random.Generator | None) -> Floats:
    """`values` with noise, rounded to whole steps of the converter."""
    if sensor.noise_rms and generator is not None:
        reading = reading + generator.normal(0.0, sensor.noise_rms, len(reading))
    if sensor.adc_step:
        reading = np.rint(reading / sensor.adc_step) * sensor.adc_step
    return reading
