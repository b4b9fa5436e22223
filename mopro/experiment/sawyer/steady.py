"""Final temperatures of steady motion back and forth, with effects of the heat domain.

Each row is the motion between two points over and over, whose heat balance is that of
Table 3.2 (eq. 3.12 to 3.26): the Reynolds number's length is the distance travelled, the path's
for two axes, and the forcer's side at rest. Effects of the heat domain change the balance
by their own hooks; at the final temperature the net heat flow is zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from mopro.effects import Active, Domain, Effect, catalogue_of
from mopro.effects.effect import Surroundings
from mopro.effects.resolve import active_effects, with_values
from mopro.effects.unlisted import with_unlisted
from mopro.engine.series import Series
from mopro.engine.tolerances import Tolerances
from mopro.experiment.sawyer.trials import Floats, SteadyTable
from mopro.machine import Machine
from mopro.motion import plan_profile
from mopro.plant import heat_balance

# Rise (K) returned where there is no steady state below it.
HOTTEST_RISE_K = 2000.0
_RESOLUTION_K = 1e-9


@dataclass(frozen=True)
class _SteadyMotion:
    """One row: the speeds (m/s) and strokes (m) of the axes that move."""

    speeds_m_s: tuple[float, ...]
    lengths_m: tuple[float, ...]

    @classmethod
    def of(cls, table: SteadyTable, row: int) -> _SteadyMotion:
        """Motion of a row: the longer stroke has the set speed if it reaches it."""
        velocity, acceleration = table.velocity_m_s[row], table.acceleration_m_s2[row]
        strokes = (abs(float(table.x_m[row])), abs(float(table.y_m[row])))
        lengths = tuple(stroke for stroke in strokes if stroke > 0)
        if not lengths or velocity <= 0 or acceleration <= 0:
            return cls((), ())
        longest = max(lengths)
        peak = plan_profile(longest, float(velocity), float(acceleration)).peak_velocity
        return cls(tuple(peak * length / longest for length in lengths), lengths)


def rises(
    table: SteadyTable, machine: Machine, effects: Mapping[str, Mapping[str, float]]
) -> Floats:
    """The final rise above the air (K) of each row of `table`.

    `effects` are on besides the machine's own, as name to parameters (SI, unstated ones at
    their defaults); those that are not of the heat domain, or change only the approach to the
    steady state, have no influence. A row without a steady state comes to HOTTEST_RISE_K.
    """
    active = _active(machine, effects)
    motions = [_SteadyMotion.of(table, row) for row in range(len(table.rise_K))]
    return np.array([_rise(machine, motion, active) for motion in motions])


def _active(machine: Machine, effects: Mapping[str, Mapping[str, float]]) -> list[Active]:
    known = with_unlisted(catalogue_of(machine))
    chosen = {a.name: a for a in active_effects(machine, known)}
    for name, values in effects.items():
        chosen[name] = with_values(known[name], values)
    return [a for a in chosen.values() if a.effect.domain is Domain.HEAT]


def _rise(machine: Machine, motion: _SteadyMotion, active: Sequence[Active]) -> float:
    balance = heat_balance(
        machine, len(motion.lengths_m), math.hypot(*motion.speeds_m_s),
        math.hypot(*motion.lengths_m),
    )  # fmt: skip
    air = machine.heat.ambient_C

    def flow_W(rise_K: float) -> float:
        here = Surroundings(
            0.0, air + rise_K, air, balance.power_W, balance.conductance_W_K,
            motion.speeds_m_s, motion.lengths_m, machine,
        )  # fmt: skip
        for a in active:
            a.effect.heat(here, *a.values)
        return here.flow_W

    coldest_K = -air - 273.0
    if flow_W(HOTTEST_RISE_K) > 0:
        return HOTTEST_RISE_K
    if flow_W(coldest_K) < 0:
        return coldest_K
    return float(optimize.brentq(flow_W, coldest_K, HOTTEST_RISE_K, xtol=_RESOLUTION_K))


def series_of_table(table: SteadyTable) -> Series:
    """The table as a Series of one sensor, each row a fold.

    A rise is the difference of two readings, so there is no offset to take out.
    """
    rows = len(table.rise_K)
    return Series(
        table.name, "temperature", "K", table.rise_K, table.noise_K,
        folds=np.arange(rows), nuisances=np.zeros((rows, 0)),
        tolerances=Tolerances(gain=table.gain_tolerance),
    )  # fmt: skip


def lasts(effect: Effect, machine: Machine) -> bool:
    """True if the effect changes the final temperature of a motion, not only the approach to it."""
    one = np.array([0.1])
    motion = SteadyTable("", one, one, one, 0 * one, one, None)
    largest = {effect.name: {p.name: p.plausible[1] for p in effect.parameters}}
    return bool((rises(motion, machine, largest) != rises(motion, machine, {})).any())
