"""The forcer's temperature with effects of the heat stage, or with currents that change.

    m c_p dT/dt = P - hA (T - T_air) + what the effects add

by RK4 in steps of at most ten seconds, far below the time constant of an hour; between
the nodes a cubic with the right slopes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mopro.emulator.command import Floats
from mopro.emulator.effects import Active
from mopro.emulator.effects.base import Surroundings
from mopro.emulator.engine import Strength
from mopro.emulator.heat import HeatBalance, heat_pieces
from mopro.machine import Machine
from mopro.motion import PlannedMove

_LONGEST_STEP_S = 10.0
_PAIRS_PER_AXIS = 2


class SteppedHeat:
    """As HeatHistory, up to `until_s`, with effects and with each axis' share of current."""

    def __init__(
        self,
        machine: Machine,
        moves: Sequence[PlannedMove],
        effects: Sequence[Active],
        strengths: Mapping[int, Strength],
        until_s: float,
    ) -> None:
        self._machine = machine
        self._effects = effects
        self._strengths = strengths
        self._capacity_J_K = machine.axis.moving_mass_kg * machine.heat.specific_heat_J_kg_K
        starts, balances = heat_pieces(machine, moves)
        self._starts_s = np.array(starts)
        self._balances = balances
        self._integrate(_nodes(self._starts_s, strengths, until_s))

    def temperature_C(self, time_s: Floats) -> Floats:
        """Temperature at these times; they may not lie beyond the end."""
        i = np.clip(np.searchsorted(self._time, time_s, side="right") - 1, 0, len(self._time) - 2)
        h = self._time[i + 1] - self._time[i]
        u = np.clip((time_s - self._time[i]) / h, 0.0, 1.0)
        start, end = self._temperature[i], self._temperature[i + 1]
        rise, fall = self._slope_after[i] * h, self._slope_before[i + 1] * h
        curve: Floats = (
            start * (1 + 2 * u) * (1 - u) ** 2
            + rise * u * (1 - u) ** 2
            + end * u**2 * (3 - 2 * u)
            - fall * u**2 * (1 - u)
        )
        return curve

    def _integrate(self, nodes: Floats) -> None:
        self._time = nodes
        count = len(nodes)
        self._temperature = np.empty(count)
        self._slope_after, self._slope_before = np.zeros(count), np.zeros(count)
        temperature = self._machine.heat.ambient_C
        self._temperature[0] = temperature
        for i in range(count - 1):
            t, h = float(nodes[i]), float(nodes[i + 1] - nodes[i])
            here = self._surroundings(t + h / 2)
            k1 = self._slope(here, t, temperature)
            k2 = self._slope(here, t + h / 2, temperature + h / 2 * k1)
            k3 = self._slope(here, t + h / 2, temperature + h / 2 * k2)
            k4 = self._slope(here, t + h, temperature + h * k3)
            temperature += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            self._temperature[i + 1] = temperature
            self._slope_after[i] = k1
            self._slope_before[i + 1] = self._slope(here, t + h, temperature)

    def _slope(self, here: Surroundings, time_s: float, temperature_C: float) -> float:
        now = replace(here, time_s=time_s, temperature_C=temperature_C)
        for active in self._effects:
            active.effect.heat(now, *active.values)
        return now.flow_W / self._capacity_J_K

    def _surroundings(self, time_s: float) -> Surroundings:
        """What holds within the step around `time_s`."""
        piece = int(np.searchsorted(self._starts_s, time_s, side="right")) - 1
        balance = self._balances[piece]
        return Surroundings(
            time_s=time_s,
            temperature_C=0.0,
            air_C=self._machine.heat.ambient_C,
            coil_W=self._coil_W(time_s, balance),
            conductance_W_K=balance.conductance_W_K,
            speeds_m_s=balance.speeds_m_s,
            lengths_m=balance.lengths_m,
            machine=self._machine,
        )

    def _coil_W(self, time_s: float, balance: HeatBalance) -> float:
        """Eq. 3.12 with each axis' own share of the current."""
        drive = self._machine.drive
        squares = [float(s.at(np.array([time_s]))[0][0]) ** 2 for s in self._strengths.values()]
        at_rest = _PAIRS_PER_AXIS * drive.phase_current_A**2 * sum(squares)
        moving = balance.moving_axes * self._machine.heat.moving_current_A**2 * max(squares)
        return (at_rest + moving) * drive.coil_resistance_ohm


def _nodes(starts_s: Floats, strengths: Mapping[int, Strength], until_s: float) -> Floats:
    """All changes up to the end, and enough times between them."""
    changes = np.unique(np.concatenate([starts_s, *(s.times_s for s in strengths.values())]))
    until_s = max(until_s, 1e-3)
    marks = np.append(changes[changes < until_s - 1e-9], until_s)
    pieces = [
        np.linspace(a, b, math.ceil((b - a) / _LONGEST_STEP_S) + 1)[:-1]
        for a, b in pairwise(marks.tolist())
    ]
    return np.append(np.concatenate(pieces), until_s)
