"""Files of an emulated run as the laboratory's instruments would have stored it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mopro.emulator.backend import Emulator
from mopro.files import output
from mopro.instruments import Lvdt, Thermocouple, write_lvdt, write_thermocouple
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.plant import interpolated, measure
from mopro.recording import Recording
from mopro.recording.envelope import Floats
from mopro.units import INCH_M


def write_readings(
    recording: Recording,
    emulator: Emulator,
    instrument: Sensor | str,
    axis: int,
    seed: int | None,
    out: Path,
) -> int:
    """Write the readings of a sensor, of the `lvdt` or the `thermocouple`; their number.

    Of a sensor as CSV, of the others also as .DAT. They have noise if there is a `seed`.
    """
    if isinstance(instrument, Sensor):
        return _sampled(recording, emulator, instrument, seed, out)
    if instrument == "lvdt":
        return _lvdt(recording, emulator, axis, seed, out)
    return _thermocouple(recording, emulator, out)


def _sampled(
    recording: Recording, emulator: Emulator, sensor: Sensor, seed: int | None, out: Path
) -> int:
    generator = None if seed is None else np.random.default_rng(seed)
    stamps, seen = measure(recording, sensor, emulator.machine, emulator.active, generator)
    _write_csv(out, sensor.column, stamps, seen)
    return len(seen)


def lvdt_duration_s() -> float:
    """The time that the LVDT's readings take."""
    lvdt = Lvdt()
    return lvdt.samples / lvdt.rate_hz + 0.1


def _lvdt(recording: Recording, emulator: Emulator, axis: int, seed: int | None, out: Path) -> int:
    """The transducer is placed where the stroke's middle is its own."""
    command_m = recording[f"command_{axis}_m"]
    lvdt = Lvdt(middle_m=float(command_m.max() + command_m.min()) / 2)
    sensor = Sensor("lvdt", POSITION, f"position_{axis}_m", lvdt.rate_hz, axis)
    _, seen = measure(recording, sensor, emulator.machine, emulator.active)
    stood = np.full(max(0, lvdt.samples - len(seen)), seen[-1])
    seen = np.concatenate((seen, stood))[: lvdt.samples]
    generator = None if seed is None else np.random.default_rng(seed)
    volts = lvdt.volts(seen, generator)
    if out.suffix.lower() == ".dat":
        write_lvdt(out, volts)
    else:
        _write_csv(
            out, f"position_{axis}_in", lvdt.times_s(), lvdt.position_m(volts) / float(INCH_M)
        )
    return len(volts)


def _thermocouple(recording: Recording, emulator: Emulator, out: Path) -> int:
    chain = Thermocouple()
    sensor = Sensor("thermocouple", TEMPERATURE, "temperature_C", recording.header.rate_hz)
    stamps, seen = measure(recording, sensor, emulator.machine, emulator.active)
    times = chain.times_s(float(stamps[-1]))
    stored = chain.stored_C(interpolated(stamps, seen, times))
    if out.suffix.lower() == ".dat":
        write_thermocouple(out, stored, times)
    else:
        _write_csv(out, "temperature_C", times, stored)
    return len(stored)


def _write_csv(out: Path, column: str, times: Floats, values: Floats) -> None:
    with output(out) as draft:
        table = np.column_stack([times, values])
        np.savetxt(draft, table, "%.9g", ",", header=f"time_s,{column}", comments="")
