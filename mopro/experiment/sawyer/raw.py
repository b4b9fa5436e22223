"""Instruments that a sensor may be: their defaults, and the readers of the thesis' raw files.

An LVDT's file has volts, proportional to the position about its centre, whose offset is
unknown; a thermocouple's file has °C and seconds. A laser and an encoder write no raw files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.experiment.sawyer.trials import Reading
from mopro.instruments import Lvdt, Thermocouple, read_lvdt, read_thermocouple
from mopro.instruments.laboratory import COUNTS_PER_C, FULL_SCALE_V
from mopro.instruments.quantity import POSITION, TEMPERATURE, Quantity
from mopro.instruments.sensor import Sensor

RAW_SUFFIX = ".dat"
_LASER_NOISE_M = 0.5e-6
_ENCODER_NOISE_M = 0.2e-6
_ENCODER_STEP_M = 1e-6


@dataclass(frozen=True)
class Kind:
    """An instrument: its quantity, the defaults of its sensor and the reader of its raw file.

    `full` is the number of readings with which its memory is full, so that the run may go on.
    """

    quantity: Quantity
    defaults: Callable[[int, Mapping[str, Any]], dict[str, Any]]
    read: Callable[[Path, Sensor], Reading] | None = None
    full: int | None = None


def _lvdt_defaults(axis: int, stated: Mapping[str, Any]) -> dict[str, Any]:
    """25 mV of ripple, a step of 4.883 mV and the bend of the data sheet, in the column's unit."""
    lvdt = Lvdt()
    column = stated.get("column", f"position_{axis}_in")
    unit_m = Sensor("lvdt", POSITION, column, 1.0).unit_si
    unit_per_V = lvdt.half_range_m / FULL_SCALE_V / unit_m
    full_range = 2 * lvdt.half_range_m / unit_m
    return {
        "name": "lvdt",
        "quantity": POSITION.name,
        "column": column,
        "rate_hz": lvdt.rate_hz,
        "noise_rms": lvdt.ripple_V * unit_per_V,
        "adc_step": lvdt.step_V * unit_per_V,
        "linearity": lvdt.linearity * full_range,
        "range": full_range,
    }


def _read_lvdt(path: Path, sensor: Sensor) -> Reading:
    """The readings; volts tell where in its range the transducer was."""
    lvdt = Lvdt()
    position_m = lvdt.position_m(read_lvdt(path, samples=None))
    half = lvdt.half_range_m / sensor.unit_si
    sensor = replace(sensor, range=(-half, half))
    return Reading(sensor, np.arange(len(position_m)) / sensor.rate_hz, position_m / sensor.unit_si)


def _thermocouple_defaults(axis: int, stated: Mapping[str, Any]) -> dict[str, Any]:
    """The converter's step; the source states no other noise."""
    return {
        "name": "thermocouple",
        "quantity": TEMPERATURE.name,
        "column": "temperature_C",
        "rate_hz": 1 / Thermocouple().fast_s,
        "adc_step": 1 / COUNTS_PER_C,
    }


def _read_thermocouple(path: Path, sensor: Sensor) -> Reading:
    temperature_C, time_s = read_thermocouple(path)
    return Reading(sensor, time_s, temperature_C)


def _laser_defaults(axis: int, stated: Mapping[str, Any]) -> dict[str, Any]:
    """An interferometer: 2 kHz, 0.5 µm of air between it and the forcer."""
    return _position_defaults("laser", axis, stated, 2000.0, _LASER_NOISE_M, 0.0)


def _encoder_defaults(axis: int, stated: Mapping[str, Any]) -> dict[str, Any]:
    """A linear encoder: 1 kHz, steps of 1 µm, 0.2 µm of noise before them."""
    return _position_defaults("encoder", axis, stated, 1000.0, _ENCODER_NOISE_M, _ENCODER_STEP_M)


def _position_defaults(
    name: str, axis: int, stated: Mapping[str, Any], rate_hz: float, noise_m: float, step_m: float
) -> dict[str, Any]:
    column = stated.get("column", f"position_{axis}_mm")
    unit_m = Sensor(name, POSITION, column, rate_hz).unit_si
    return {
        "name": name,
        "quantity": POSITION.name,
        "column": column,
        "rate_hz": rate_hz,
        "noise_rms": noise_m / unit_m,
        "adc_step": step_m / unit_m,
    }


KINDS = {
    "lvdt": Kind(POSITION, _lvdt_defaults, _read_lvdt, full=Lvdt().samples),
    "thermocouple": Kind(TEMPERATURE, _thermocouple_defaults, _read_thermocouple),
    "laser": Kind(POSITION, _laser_defaults),
    "encoder": Kind(POSITION, _encoder_defaults),
}
RAW_KINDS = tuple(name for name, kind in KINDS.items() if kind.read is not None)
