"""The forcer's temperature over a run: chapter 3.1 with its errata.

    m c_p dT/dt = P - hA (T - T_air)

Between the starts and ends of moves P and hA are constant, and the solution is exact.
P counts the four coil pairs (two forcers on each axis) at rest current and the extra of
each moving axis (eq. 3.12; eq. 3.22 misprints it); its ripple at the step frequency is
far too fast for the forcer's heat capacity and is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.machine import Machine
from mopro.motion import PlannedMove

_COIL_PAIRS = 4


@dataclass(frozen=True)
class HeatBalance:
    """Constant heating: `power_W` in, `conductance_W_K` (hA) out to the air.

    `moving_axes`, `speeds_m_s` and `lengths_m` are those of the motion it comes from.
    """

    power_W: float
    conductance_W_K: float
    moving_axes: int = 0
    speeds_m_s: tuple[float, ...] = ()
    lengths_m: tuple[float, ...] = ()

    @property
    def rise_K(self) -> float:
        """Final temperature above the air (eq. 3.26)."""
        return self.power_W / self.conductance_W_K


def heat_balance(
    machine: Machine, moving_axes: int, speed_m_s: float, length_m: float
) -> HeatBalance:
    """The balance of steady motion back and forth.

    The Reynolds number's length (eq. 3.17) is the travelled one, and the forcer's side
    at rest: the reading that reproduces Table 3.2.
    """
    heat, drive = machine.heat, machine.drive
    power = (
        _COIL_PAIRS * drive.phase_current_A**2 + moving_axes * heat.moving_current_A**2
    ) * drive.coil_resistance_ohm
    length = length_m if moving_axes else heat.forcer_side_m
    bearing_m_s = heat.bearing_flow_m3_s / heat.bearing_area_m2
    sides = _film_W_m2_K(machine, speed_m_s, length) * heat.side_area_m2
    top = _film_W_m2_K(machine, speed_m_s + bearing_m_s, length) * heat.top_area_m2
    return HeatBalance(power, sides + top, moving_axes)


def _film_W_m2_K(machine: Machine, air_m_s: float, length_m: float) -> float:
    """h of a flat plate in laminar flow (eq. 3.16, 3.17)."""
    heat = machine.heat
    reynolds = air_m_s * length_m / heat.air_viscosity_m2_s
    nusselt = 0.664 * math.sqrt(reynolds) * math.cbrt(heat.prandtl_number)
    return nusselt * heat.air_conductivity_W_m_K / heat.forcer_side_m


@dataclass(frozen=True)
class HeatIntervals:
    """Times (s) at which the heating changes, and the number of the balance from each on."""

    starts_s: NDArray[np.float64]
    number: NDArray[np.intp]
    balances: tuple[HeatBalance, ...]


class HeatHistory:
    """Temperature over a schedule's moves, from the ambient one at time 0.

    `intervals` are what `heat_intervals` makes of the moves, for whoever needs them again.
    """

    def __init__(
        self,
        machine: Machine,
        moves: Iterable[PlannedMove],
        intervals: HeatIntervals | None = None,
    ) -> None:
        self._capacity_J_K = machine.axis.moving_mass_kg * machine.heat.specific_heat_J_kg_K
        self.intervals = known = intervals or heat_intervals(machine, moves)
        rises = np.array([b.rise_K for b in known.balances])
        rates = np.array([b.conductance_W_K for b in known.balances]) / self._capacity_J_K
        self._starts_s = known.starts_s
        self._final_C = machine.heat.ambient_C + rises[known.number]
        self._rate_1_s = rates[known.number]
        decays = np.exp(-np.diff(self._starts_s) * self._rate_1_s[:-1]).tolist()
        temperatures = [machine.heat.ambient_C]
        for final, decay in zip(self._final_C.tolist(), decays, strict=False):
            temperatures.append(final + (temperatures[-1] - final) * decay)
        self._initial_C = np.array(temperatures)

    def temperature_C(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        interval = np.searchsorted(self._starts_s, time_s, side="right") - 1
        return self._solution(interval, time_s)

    def _solution(
        self, interval: NDArray[np.intp], time_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        final = self._final_C[interval]
        decay = np.exp(-(time_s - self._starts_s[interval]) * self._rate_1_s[interval])
        solution: NDArray[np.float64] = final + (self._initial_C[interval] - final) * decay
        return solution


def heat_intervals(machine: Machine, moves: Iterable[PlannedMove]) -> HeatIntervals:
    """The times at which the heating changes, and the balance from each on."""
    moving = [move for move in moves if move.profile.distance]
    times_s = np.array([move.start_s for move in moving] + [move.end_s for move in moving])
    of_move = np.tile(np.arange(len(moving)), 2)
    order = np.lexsort((of_move, times_s))
    starts, number = [0.0], [0]
    balances = {heat_balance(machine, 0, 0.0, 0.0): 0}
    under_way: dict[int, _Motion] = {}
    known: dict[tuple[_Motion, ...], int] = {(): 0}
    for time_s, move in zip(times_s[order].tolist(), of_move[order].tolist(), strict=True):
        if under_way.pop(move, None) is None:
            under_way[move] = _motion(moving[move])
        motions = tuple(under_way.values())
        if motions not in known:
            known[motions] = balances.setdefault(_balance_of(machine, motions), len(balances))
        if time_s > starts[-1]:
            starts.append(time_s)
            number.append(0)
        number[-1] = known[motions]
    return HeatIntervals(np.array(starts), np.array(number), tuple(balances))


# A move's peak velocity over its distance, and each axis' length (microsteps, seconds).
_Motion = tuple[float, tuple[int, ...]]


def _motion(move: PlannedMove) -> _Motion:
    lengths = tuple(abs(stroke.length_u) for stroke in move.strokes)
    return move.profile.peak_velocity / move.profile.distance, lengths


def _balance_of(machine: Machine, motions: Sequence[_Motion]) -> HeatBalance:
    """Moves at their peak velocity along their path (eq. 3.18 ignores the ramps)."""
    scale = machine.microstep_m
    strokes = [(rate, length * scale) for rate, lengths in motions for length in lengths if length]
    speeds = tuple(rate * length for rate, length in strokes)
    lengths_m = tuple(length for _, length in strokes)
    balance = heat_balance(machine, len(strokes), math.hypot(*speeds), math.hypot(*lengths_m))
    return replace(balance, speeds_m_s=speeds, lengths_m=lengths_m)
