"""Columns of a recording from the motion of the axes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.plant.axis import Samples
from mopro.plant.command_table import Floats
from mopro.plant.platen import yaw_rad
from mopro.recording.record import Columns


def columns_of(
    times: Floats,
    samples: Mapping[int, Samples],
    temperature_C: Floats,
    schedule: Schedule,
    machine: Machine,
) -> Columns:
    """All columns at `times` from the `samples` of each axis, in their order."""
    columns: Columns = {"time_s": times}
    for n, of_axis in samples.items():
        columns |= _axis_columns(n, of_axis)
    columns["temperature_C"] = temperature_C
    columns["line"] = _lines(schedule, times)
    for n, of_axis in samples.items():
        if of_axis.voltage_a_V is not None and of_axis.voltage_b_V is not None:
            columns[f"voltage_a_{n}_V"] = of_axis.voltage_a_V
            columns[f"voltage_b_{n}_V"] = of_axis.voltage_b_V
    if machine.forcers is not None:
        lags = {n: s.command_m - s.position_m for n, s in samples.items()}
        columns["yaw_rad"] = yaw_rad(machine.forcers, machine.axis.wave_number_1_m, lags)
    return columns


def _axis_columns(n: int, samples: Samples) -> Columns:
    return {
        f"command_{n}_m": samples.command_m,
        f"position_{n}_m": samples.position_m,
        f"velocity_{n}_m_s": samples.velocity_m_s,
        f"phase_a_{n}_A": samples.phase_a_A,
        f"phase_b_{n}_A": samples.phase_b_A,
        f"force_{n}_N": samples.force_N,
    }


def _lines(schedule: Schedule, times: Floats) -> NDArray[np.int32]:
    """The running source line at each time; before anything takes time, the first one."""
    if not schedule.activity:
        return np.full(len(times), schedule.program.ops[0].span.line, dtype=np.int32)
    starts, lines = zip(*schedule.activity, strict=True)
    at = np.searchsorted(np.array(starts), times, side="right") - 1
    return np.array(lines, dtype=np.int32)[np.maximum(at, 0)]
