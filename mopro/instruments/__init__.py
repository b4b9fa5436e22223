"""Instruments of the thesis's laboratory: conversion between a run and its data files."""

from mopro.instruments.laboratory import (
    Lvdt,
    Thermocouple,
    block_velocity,
    read_lvdt,
    read_thermocouple,
    write_lvdt,
    write_thermocouple,
)

__all__ = [
    "Lvdt",
    "Thermocouple",
    "block_velocity",
    "read_lvdt",
    "read_thermocouple",
    "write_lvdt",
    "write_thermocouple",
]
