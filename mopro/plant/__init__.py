"""The plant: equation of motion, heat, platen, trips and measurement.

`simulate` is the one way in: a schedule and a machine give a `Simulation`, which is taken
through time. Other rooms use the names below and none of the modules behind them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mopro.plant.axis import MOST_SETTLING_S, SETTLED_M
    from mopro.plant.command_table import CommandTable, change_schedule, plan_with_effects
    from mopro.plant.heat import HeatIntervals, heat_balance, heat_intervals
    from mopro.plant.integration import Stepping
    from mopro.plant.measurement import interpolated, measure, measured_at
    from mopro.plant.platen import elongation_m, platen_result
    from mopro.plant.repetition import Repetition
    from mopro.plant.simulation import (
        COMPILE_FROM_STEPS,
        MAX_STEP_S,
        Simulation,
        compiling_pays,
        simulate,
    )
    from mopro.plant.trial import try_out
    from mopro.plant.trips import Trip, limit_trip, switches_u

# Names are imported at their first use, so that a heat balance does not load the kernel.
_HOMES = {
    "COMPILE_FROM_STEPS": "simulation",
    "MAX_STEP_S": "simulation",
    "MOST_SETTLING_S": "axis",
    "SETTLED_M": "axis",
    "CommandTable": "command_table",
    "HeatIntervals": "heat",
    "Repetition": "repetition",
    "Simulation": "simulation",
    "Stepping": "integration",
    "Trip": "trips",
    "change_schedule": "command_table",
    "compiling_pays": "simulation",
    "elongation_m": "platen",
    "heat_balance": "heat",
    "heat_intervals": "heat",
    "interpolated": "measurement",
    "limit_trip": "trips",
    "measure": "measurement",
    "measured_at": "measurement",
    "plan_with_effects": "command_table",
    "platen_result": "platen",
    "simulate": "simulation",
    "switches_u": "trips",
    "try_out": "trial",
}

__all__ = [
    "COMPILE_FROM_STEPS",
    "MAX_STEP_S",
    "MOST_SETTLING_S",
    "SETTLED_M",
    "CommandTable",
    "HeatIntervals",
    "Repetition",
    "Simulation",
    "Stepping",
    "Trip",
    "change_schedule",
    "compiling_pays",
    "elongation_m",
    "heat_balance",
    "heat_intervals",
    "interpolated",
    "limit_trip",
    "measure",
    "measured_at",
    "plan_with_effects",
    "platen_result",
    "simulate",
    "switches_u",
    "try_out",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mopro.plant' has no attribute '{name}'")
    return getattr(importlib.import_module(f"mopro.plant.{_HOMES[name]}"), name)
