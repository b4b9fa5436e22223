"""Finds the time at which a program heats the motor above its rated temperature."""

from __future__ import annotations

import math
from typing import NamedTuple

from mopro.machine import Machine
from mopro.motion import PlannedMove, Survey
from mopro.program import AXES
from mopro.source import Span

_COIL_PAIRS = 4


class Overheating(NamedTuple):
    """The motor passes its rating after `after_s`, and would reach `final_C` (°C)."""

    after_s: float
    final_C: float
    span: Span


def can_overheat(machine: Machine, duration_s: float) -> bool:
    """True if the heat of `duration_s` (s) would suffice without any loss."""
    heat, drive = machine.heat, machine.drive
    squares = _COIL_PAIRS * drive.phase_current_A**2 + len(AXES) * heat.moving_current_A**2
    energy_J = squares * drive.coil_resistance_ohm * duration_s
    capacity_J_K = machine.axis.moving_mass_kg * heat.specific_heat_J_kg_K
    return energy_J / capacity_J_K > heat.rated_C - heat.ambient_C


def overheating(machine: Machine, survey: Survey, loops: bool) -> Overheating | None:
    """The first time at which the temperature passes the rating, or None if it never does."""
    import numpy as np

    from mopro.plant import simulate

    moves = survey.schedule.moves
    if not moves:
        return None
    simulation = simulate(survey.schedule, machine, active=())
    ends_s = np.array([move.end_s for move in moves])
    above = np.flatnonzero(simulation.temperature_C(ends_s) > machine.heat.rated_C)
    if len(above):
        hot = moves[int(above[0])]
        return Overheating(hot.end_s, float(simulation.temperature_C(ends_s).max()), hot.span)
    if not loops or len(survey.laps) < 3:
        return None
    laps_s = np.array([lap.time_s for lap in survey.laps[-3:]])
    return _in_the_long_run(
        machine, laps_s.tolist(), simulation.temperature_C(laps_s).tolist(), moves
    )


def _in_the_long_run(
    machine: Machine, laps_s: list[float], laps_C: list[float], moves: tuple[PlannedMove, ...]
) -> Overheating | None:
    """Extrapolate the temperatures of three laps, which approach the final one geometrically."""
    first, second, third = laps_C
    if second == first or third == second:
        return None
    ratio = (third - second) / (second - first)
    if not 0 < ratio < 1:
        return None
    final_C = third + (third - second) * ratio / (1 - ratio)
    rated_C = machine.heat.rated_C
    if final_C <= rated_C:
        return None
    rounds = math.log((final_C - rated_C) / (final_C - third)) / math.log(ratio)
    after_s = laps_s[2] + rounds * (laps_s[2] - laps_s[1])
    return Overheating(after_s, final_C, moves[-1].span)
