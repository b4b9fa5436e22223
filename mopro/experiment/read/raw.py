"""Readers and default sensors for the data files of the thesis' instruments.

An LVDT's file has volts, proportional to the position about its centre, whose offset is
unknown; a thermocouple's file has °C and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mopro.experiment.model import Reading
from mopro.instruments import Lvdt, Thermocouple, read_lvdt, read_thermocouple
from mopro.instruments.lvdt import FULL_SCALE_V
from mopro.instruments.quantity import POSITION, TEMPERATURE, Quantity
from mopro.instruments.sensor import Sensor
from mopro.instruments.thermocouple import COUNTS_PER_C

RAW_SUFFIX = ".dat"


@dataclass(frozen=True)
class Kind:
    """An instrument: its quantity, the defaults of its sensor and the reader of its file."""

    quantity: Quantity
    defaults: Callable[[int, Mapping[str, Any]], dict[str, Any]]
    read: Callable[[Path, Sensor], Reading]


def _lvdt_defaults(axis: int, stated: Mapping[str, Any]) -> dict[str, Any]:
    """25 mV of ripple and a step of 4.883 mV, in the column's unit."""
    lvdt = Lvdt()
    column = stated.get("column", f"position_{axis}_in")
    unit_m = Sensor("lvdt", POSITION, column, 1.0).unit_si
    unit_per_V = lvdt.half_range_m / FULL_SCALE_V / unit_m
    return {
        "name": "lvdt",
        "quantity": POSITION.name,
        "column": column,
        "rate_hz": lvdt.rate_hz,
        "noise_rms": lvdt.ripple_V * unit_per_V,
        "adc_step": lvdt.step_V * unit_per_V,
    }


def _read_lvdt(path: Path, sensor: Sensor) -> Reading:
    lvdt = Lvdt()
    position_m = lvdt.position_m(read_lvdt(path, samples=None))
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


KINDS = {
    "lvdt": Kind(POSITION, _lvdt_defaults, _read_lvdt),
    "thermocouple": Kind(TEMPERATURE, _thermocouple_defaults, _read_thermocouple),
}
