"""The forcer's temperature with effects of the heat domain, or with currents that change.

    m c_p dT/dt = P - hA (T - T_air) + what the effects add

by RK4 in steps of at most ten seconds, far below the time constant of an hour. A loop
moves many times in one step: the distinct balances that hold within a step are weighed
by their shares of it, and the course of the temperature inside follows from the slope of
whichever holds. So a run of hours costs by its length, not by its moves.

A temperature that runs away, as under a heat flow that grows with it, is NaN from there on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mopro.effects import Active
from mopro.effects.effect import Surroundings
from mopro.engine.series import RUN_AWAY
from mopro.machine import Machine
from mopro.motion import PlannedMove
from mopro.plant.command_table import Floats, hermite
from mopro.plant.drive_scaling import DriveScaling
from mopro.plant.heat import HeatBalance, HeatIntervals, heat_intervals

_LONGEST_STEP_S = 10.0
# Changes up to this many are each the end of a step.
_FEW_CHANGES = 100
_PAIRS_PER_AXIS = 2

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class _Conditions:
    """Conditions between two changes: the heat balance and the power of the coils."""

    balance: HeatBalance
    coil_W: float


class SteppedHeat:
    """As HeatHistory, up to `until_s`, with effects and with each axis' share of current."""

    def __init__(
        self,
        machine: Machine,
        moves: Sequence[PlannedMove],
        effects: Sequence[Active],
        scalings: Mapping[int, DriveScaling],
        until_s: float,
        intervals: HeatIntervals | None = None,
    ) -> None:
        self._machine = machine
        self._effects = effects
        self._capacity_J_K = machine.axis.moving_mass_kg * machine.heat.specific_heat_J_kg_K
        self.intervals = known = intervals or heat_intervals(machine, moves)
        until_s = max(until_s, 1e-3)
        changes = _changes(known.starts_s, scalings, until_s)
        steps = _steps(changes, until_s)
        self._time = np.union1d(steps, changes)
        middle = (self._time[:-1] + self._time[1:]) / 2
        kind, kinds = self._kinds(middle, known, scalings)
        step = np.searchsorted(steps, middle) - 1
        self._integrate(steps, step, kind, kinds)

    def temperature_C(self, time_s: Floats) -> Floats:
        """Temperature (°C) at `times`, none beyond the end."""
        i = np.clip(np.searchsorted(self._time, time_s, side="right") - 1, 0, len(self._time) - 2)
        h = self._time[i + 1] - self._time[i]
        u = np.clip((time_s - self._time[i]) / h, 0.0, 1.0)
        start, end = self._temperature[i], self._temperature[i + 1]
        rise, fall = self._slope_after[i] * h, self._slope_before[i] * h
        return hermite(u, start, end, rise, fall)

    def _kinds(
        self, time_s: Floats, intervals: HeatIntervals, scalings: Mapping[int, DriveScaling]
    ) -> tuple[Indices, list[_Conditions]]:
        """Index of the condition that holds at each time, and the distinct conditions."""
        rows = np.searchsorted(intervals.starts_s, time_s, side="right") - 1
        balance = kind = intervals.number[rows]
        gains = [scaling.at(time_s)[0] for scaling in scalings.values()]
        for scaling in scalings.values():
            distinct, number = np.unique(scaling.gain, return_inverse=True)
            kind = kind * len(distinct) + number[scaling.rows_at(time_s)]
        _, first, kind = np.unique(kind, return_index=True, return_inverse=True)
        kinds = []
        for i in first.tolist():
            own = intervals.balances[balance[i]]
            coil_W = _coil_W(self._machine, own, [float(gain[i]) for gain in gains])
            kinds.append(_Conditions(own, coil_W))
        return kind, kinds

    def _integrate(
        self, steps: Floats, step: Indices, kind: Indices, kinds: Sequence[_Conditions]
    ) -> None:
        """The temperature at all nodes, from the `step` and `kind` of what lies between them."""
        lengths, whole = np.diff(self._time), np.diff(steps)[step]
        shares = np.zeros((len(steps) - 1, len(kinds)))
        np.add.at(shares, (step, kind), lengths / whole)
        coarse, after, before = self._through(steps, shares, kinds)
        starts, slope = (self._time[:-1] - steps[step]) / whole, after[step, kind]
        growth = before[step, kind] - slope
        self._slope_after = slope + starts * growth
        self._slope_before = slope + (starts + lengths / whole) * growth
        rises = lengths * (self._slope_after + self._slope_before) / 2
        self._temperature = _led_through(self._time, rises, steps, coarse)

    def _through(
        self, steps: Floats, shares: Floats, kinds: Sequence[_Conditions]
    ) -> tuple[Floats, Floats, Floats]:
        """Temperature at the steps, and each kind's slope at both ends of each step."""
        temperature = np.full(len(steps), self._machine.heat.ambient_C)
        after, before = np.zeros(shares.shape), np.zeros(shares.shape)
        forcer_C = float(temperature[0])
        for i, (t, end) in enumerate(pairwise(steps.tolist())):
            held = [(k, kinds[k], float(shares[i, k])) for k in np.flatnonzero(shares[i]).tolist()]
            h = end - t
            first = [self._slope(c, t, forcer_C) for _, c, _ in held]
            k1 = sum(s * share for s, (_, _, share) in zip(first, held, strict=True))
            k2 = self._mean_slope(held, t + h / 2, forcer_C + h / 2 * k1)
            k3 = self._mean_slope(held, t + h / 2, forcer_C + h / 2 * k2)
            k4 = self._mean_slope(held, end, forcer_C + h * k3)
            forcer_C += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            if not abs(forcer_C) < RUN_AWAY:
                temperature[i + 1 :] = after[i:] = before[i:] = math.nan
                break
            temperature[i + 1] = forcer_C
            for (k, conditions, _), slope in zip(held, first, strict=True):
                after[i, k] = slope
                before[i, k] = self._slope(conditions, end, forcer_C)
        return temperature, after, before

    def _mean_slope(
        self, held: Sequence[tuple[int, _Conditions, float]], time_s: float, temperature_C: float
    ) -> float:
        return sum(share * self._slope(c, time_s, temperature_C) for _, c, share in held)

    def _slope(self, conditions: _Conditions, time_s: float, temperature_C: float) -> float:
        balance = conditions.balance
        surroundings = Surroundings(
            time_s,
            temperature_C,
            self._machine.heat.ambient_C,
            conditions.coil_W,
            balance.conductance_W_K,
            balance.speeds_m_s,
            balance.lengths_m,
            self._machine,
        )
        try:
            for active in self._effects:
                active.effect.heat(surroundings, *active.values)
        except OverflowError:  # plain Python raises it at a power
            return math.nan
        return surroundings.flow_W / self._capacity_J_K


def _coil_W(machine: Machine, balance: HeatBalance, gains: Sequence[float]) -> float:
    """Eq. 3.12 with each axis' own share of the current."""
    drive = machine.drive
    squares = [gain**2 for gain in gains]
    at_rest = _PAIRS_PER_AXIS * drive.phase_current_A**2 * sum(squares)
    moving = balance.moving_axes * machine.heat.moving_current_A**2 * max(squares)
    return (at_rest + moving) * drive.coil_resistance_ohm


def coil_energy_J(
    machine: Machine,
    intervals: HeatIntervals,
    scalings: Mapping[int, DriveScaling],
    until_s: float,
) -> float:
    """Heat (J) of the coils up to `until_s`, at the resistance that the machine states."""
    starts = _changes(intervals.starts_s, scalings, until_s)
    rows = np.searchsorted(intervals.starts_s, starts, side="right") - 1
    gains = np.array([scaling.at(starts)[0] for scaling in scalings.values()])
    powers_W = [
        _coil_W(machine, intervals.balances[number], own)
        for number, own in zip(intervals.number[rows].tolist(), gains.T.tolist(), strict=True)
    ]
    return float(np.dot(powers_W, np.diff(starts, append=until_s)))


def _led_through(time_s: Floats, rises: Floats, steps: Floats, coarse: Floats) -> Floats:
    """The temperature at all times: `rises` between them, led through the steps' own."""
    summed = np.concatenate([[0.0], np.cumsum(rises)])
    error = coarse - summed[np.searchsorted(time_s, steps)]
    led: Floats = summed + np.interp(time_s, steps, error)
    return led


def _changes(starts_s: Floats, scalings: Mapping[int, DriveScaling], until_s: float) -> Floats:
    """Times before the end at which the conditions change."""
    changes = np.unique(np.concatenate([starts_s, *(s.times_s for s in scalings.values())]))
    return changes[changes < until_s - 1e-9]


def _steps(changes: Floats, until_s: float) -> Floats:
    """Times of the steps: the changes, if they are few, and enough between them."""
    few = len(changes) <= max(_FEW_CHANGES, until_s / _LONGEST_STEP_S)
    marks = np.append(changes if few else changes[:1], until_s)
    parts = [
        np.linspace(a, b, math.ceil((b - a) / _LONGEST_STEP_S) + 1)[:-1]
        for a, b in pairwise(marks.tolist())
    ]
    return np.append(np.concatenate(parts), until_s)
