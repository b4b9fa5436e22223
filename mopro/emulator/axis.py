"""One emulated axis: its motion piece by piece, and what becomes of each of its moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.emulator.command import CommandTable, Floats
from mopro.machine import Machine
from mopro.motion import PlannedMove
from mopro.motion.track import Track

# An axis this close to its tooth, and as slow, is taken to rest where it is. What it would
# still have rung stays within a nanometre of that.
REST_M = 4e-10
_SETTLING_S = 0.05
_MOST_SETTLING_S = 10.0

Integrate = Callable[..., int]


@dataclass(frozen=True)
class Plant:
    """The equation of motion's constants for one axis; `resolved` as for the integrator."""

    wave_number_1_m: float
    pitch_m: float
    pull_out_m_s2: float
    damping_1_s: float
    microstep_m: float
    resolved: bool
    max_step_s: float

    @classmethod
    def of(cls, machine: Machine, payload_kg: float, resolved: bool, max_step_s: float) -> Plant:
        axis = machine.axis
        mass = axis.moving_mass_kg + payload_kg
        return cls(
            wave_number_1_m=axis.wave_number_1_m,
            pitch_m=axis.pitch_m,
            pull_out_m_s2=axis.pull_out_force_N / mass,
            damping_1_s=axis.drive_damping_N_s_m / mass,
            microstep_m=machine.microstep_m,
            resolved=resolved,
            max_step_s=max_step_s,
        )


class EmulatedAxis:
    """Goes through time once; `advance` gives the motion at the samples asked for."""

    def __init__(
        self,
        number: int,
        plant: Plant,
        track: Track,
        moves: Sequence[PlannedMove],
        integrate: Integrate,
    ) -> None:
        self.number = number
        self._plant = plant
        self._command = CommandTable(track)
        self._integrate = integrate
        self._now_s = 0.0
        self._x = 0.0
        self._v = 0.0
        self.fates = _Fates([m for m in moves if number in m.axes], plant)

    def advance(self, samples_s: Floats, end_s: float) -> tuple[Floats, Floats]:
        """Position (m) and velocity (m/s) at `samples_s`; the axis goes on to `end_s`.

        Samples ascend and lie between the time reached before and `end_s`.
        """
        corners = self._command.corners_s(self._now_s, end_s)
        knots = np.union1d(np.concatenate(([self._now_s, end_s], corners)), samples_s)
        position, velocity, low, high = self._through(knots)
        self.fates.watch(knots, self._lags(knots, position), low, high)
        self._now_s = float(knots[-1])
        at = np.searchsorted(knots, samples_s)
        return position[at], velocity[at]

    def settle(self) -> None:
        """Under a command at rest, wait until the tooth that holds the axis is certain."""
        deadline_s = self._now_s + _MOST_SETTLING_S
        resting = self._command.at_rest(self._now_s)
        while resting and not self._captured() and self._now_s < deadline_s:
            knots = np.array([self._now_s, self._now_s + _SETTLING_S])
            self._through(knots)
            self._now_s = float(knots[1])
        self.fates.finish(self._lag_m())

    def command_m(self, time_s: Floats) -> Floats:
        """What the drive is told: whole microsteps where they are resolved."""
        command = self._command.position_u(time_s)
        if self._plant.resolved:
            command = np.floor(command + 0.5)
        return command * self._plant.microstep_m

    def _through(self, knots: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Integrate over `knots` from the present state, and keep the last one."""
        plant = self._plant
        count = len(knots)
        outputs = np.zeros((4, count))
        outputs[0, 0], outputs[1, 0] = self._x, self._v
        arrays = [knots, self._command.rows_at(knots[:-1]), *self._command.coefficients]
        plain = self._integrate.__module__ == "mopro.emulator.kernel"
        inputs = [array.tolist() for array in arrays] if plain else arrays
        results = [row.tolist() for row in outputs] if plain else list(outputs)
        self._integrate(
            *inputs,
            plant.wave_number_1_m,
            plant.pull_out_m_s2,
            plant.damping_1_s,
            plant.microstep_m,
            plant.resolved,
            plant.max_step_s,
            REST_M,
            *results,
        )
        position, velocity, low, high = (np.asarray(result) for result in results)
        self._x, self._v = float(position[-1]), float(velocity[-1])
        return position, velocity, low[:-1], high[:-1]

    def _lags(self, time_s: Floats, position: Floats) -> Floats:
        return self._command.position_u(time_s) * self._plant.microstep_m - position

    def _lag_m(self) -> float:
        """The lag now."""
        return float(self._lags(np.array([self._now_s]), np.array([self._x]))[0])

    def _captured(self) -> bool:
        """Whether the energy left is too small to pass over to another tooth."""
        plant = self._plant
        depth = plant.pull_out_m_s2 / plant.wave_number_1_m
        energy = self._v**2 / 2 + depth * (1 - math.cos(plant.wave_number_1_m * self._lag_m()))
        return energy < 2 * depth


class _Fates:
    """The lag of one axis in each of its moves, gathered piece by piece.

    `teeth` are the pitches by which the axis is behind its command, before each move
    and at the end.
    """

    def __init__(self, moves: Sequence[PlannedMove], plant: Plant) -> None:
        self._pitch_m = plant.pitch_m
        self._wave_number = plant.wave_number_1_m
        self._index = {id(move): i for i, move in enumerate(moves)}
        self._starts_s = np.array([move.start_s for move in moves])
        self._ends_s = np.array([move.end_s for move in moves])
        self._low_m = np.full(len(moves), np.inf)
        self._high_m = np.full(len(moves), -np.inf)
        self._teeth = np.zeros(len(moves) + 1, dtype=np.int64)

    def watch(self, knots: Floats, lags: Floats, low: Floats, high: Floats) -> None:
        """Take in the lag at `knots` and its extremes between them (m)."""
        if not len(self._starts_s):
            return
        first, last = np.searchsorted(self._starts_s, [knots[0], knots[-1]])
        at = np.searchsorted(knots, self._starts_s[first:last])
        self._teeth[first:last] = self._tooth(lags[at])
        move = np.searchsorted(self._starts_s, knots[:-1], side="right") - 1
        inside = (move >= 0) & (knots[:-1] < self._ends_s[move])
        np.minimum.at(self._low_m, move[inside], low[inside])
        np.maximum.at(self._high_m, move[inside], high[inside])

    def finish(self, lag_m: float) -> None:
        self._teeth[-1] = self._tooth(np.array([lag_m]))[0]

    def of(self, move: PlannedMove) -> Fate:
        i = self._index[id(move)]
        lost = int(self._teeth[i + 1] - self._teeth[i])
        if self._low_m[i] > self._high_m[i]:
            return Fate(0.0, 1.0, lost, bool(lost))
        home = self._teeth[i] * self._pitch_m
        largest = float(max(self._high_m[i] - home, home - self._low_m[i]))
        quarter = self._pitch_m / 4
        margin = 1 - math.sin(self._wave_number * largest) if largest < quarter else 0.0
        return Fate(largest, margin, lost, bool(lost) or largest > 2 * quarter)

    def _tooth(self, lags: Floats) -> NDArray[np.int64]:
        return np.rint(lags / self._pitch_m).astype(np.int64)


@dataclass(frozen=True)
class Fate:
    """How one axis fared in one move.

    `max_lag_m` is counted from the tooth that held it at the start, `stall_margin` is
    1 - |F|/F0 at the worst moment, 0 from a quarter pitch of lag on, where the force
    falls again; `lost_pitches` is positive where the axis stayed behind.
    """

    max_lag_m: float
    stall_margin: float
    lost_pitches: int
    slipped: bool
