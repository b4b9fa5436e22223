"""Instruments of the thesis's laboratory: conversion between a run and its data files."""

from mopro.instruments.daq import (
    read_lvdt,
    read_thermocouple,
    write_lvdt,
    write_thermocouple,
)
from mopro.instruments.lvdt import Lvdt, block_velocity
from mopro.instruments.thermocouple import Thermocouple

__all__ = [
    "Lvdt",
    "Thermocouple",
    "block_velocity",
    "read_lvdt",
    "read_thermocouple",
    "write_lvdt",
    "write_thermocouple",
]
