"""Thermal expansion of the platen under the forcer, and the yaw of the forcer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mopro.machine import Machine
from mopro.machine.model import Forcers
from mopro.motion import PlannedMove
from mopro.plant.command_table import Floats
from mopro.program import AXES


def heated_lengths_m(forcer_side_m: float, strokes_m: Sequence[float]) -> tuple[float, float]:
    """The heated region's length along each axis.

    At rest the forcer's side; along one axis its stroke and across it the side (eq. 3.32,
    3.33); on a diagonal at the angle a from axis 1, the side times 1 + 1/tan a along
    axis 1 and times 1 + tan a along axis 2 (eq. 3.36, 3.37).
    """
    along_1, along_2 = map(abs, strokes_m)
    if along_1 and along_2:
        slope = along_2 / along_1
        return forcer_side_m * (1 + 1 / slope), forcer_side_m * (1 + slope)
    return along_1 or forcer_side_m, along_2 or forcer_side_m


def elongation_m(
    machine: Machine, rise_K: float, strokes_m: Sequence[float]
) -> dict[str, tuple[float, float]]:
    """Along axes 1 and 2 for the lowest and the highest expansion of steel (eq. 3.38, 3.39).

    The worst case: the platen as hot as the forcer, and only where that has been.
    """
    lengths = heated_lengths_m(machine.heat.forcer_side_m, strokes_m)
    platen = machine.platen
    return {
        name: (alpha * rise_K * lengths[0], alpha * rise_K * lengths[1])
        for name, alpha in (("low", platen.expansion_low_1_K), ("high", platen.expansion_high_1_K))
    }


def platen_result(
    machine: Machine, moves: Sequence[PlannedMove], hottest_C: float
) -> dict[str, object]:
    """The elongation at the end of a run that has heated the forcer to `hottest_C`."""
    longest = dict.fromkeys(AXES, 0.0)
    for move in moves:
        for stroke in move.strokes:
            length_m = abs(stroke.length_u) * machine.microstep_m
            longest[stroke.axis] = max(longest[stroke.axis], length_m)
    rise = hottest_C - machine.heat.ambient_C
    found = elongation_m(machine, rise, list(longest.values()))
    return {
        "rise_K": rise,
        "elongation_low_m": list(found["low"]),
        "elongation_high_m": list(found["high"]),
    }


def yaw_rad(forcers: Forcers, wave_number_1_m: float, lags_m: Mapping[int, Floats]) -> Floats:
    """The angle at which the four forcers' moments about the middle cancel.

    Forcer i of an axis with lag e gives F0/2 s_i sin(k (e ∓ arm ψ)) at ± arm. With ψ
    small, Σ (s1 - s2) sin ke = arm k ψ Σ (s1 + s2) cos ke, summed over the axes: equal
    forcers leave ψ = 0. Far below the yaw mode's frequency (assumed).
    """
    unequal = forcers.strength_1 - forcers.strength_2
    both = forcers.strength_1 + forcers.strength_2
    moment = sum(unequal * np.sin(wave_number_1_m * e) for e in lags_m.values())
    stiffness = sum(both * np.cos(wave_number_1_m * e) for e in lags_m.values())
    return np.asarray(moment / (forcers.arm_m * wave_number_1_m * stiffness), dtype=np.float64)
