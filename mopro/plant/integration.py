"""Integrates one axis with the kernel composed for its effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from mopro.effects import Active
from mopro.machine.constants import PlantConstants
from mopro.plant.command_table import CommandTable, Floats
from mopro.plant.drive_scaling import DriveScaling
from mopro.plant.kernel.build import kernel, rates
from mopro.plant.kernel.drive import CURRENT_LOOP_S
from mopro.plant.kernel.effect_terms import TermSet
from mopro.plant.kernel.equation_of_motion import State, start_of
from mopro.plant.kernel.integrate import Plant, axis_and_drive
from mopro.plant.repetition import Course

# An axis this close to its tooth, and as slow, is at rest. Its remaining oscillation would
# stay within a nanometre.
REST_M = 4e-10
_MOST_RELAXATIONS = 400
# What plain Python raises where compiled code goes on with NaN: at the sine of infinity.
_NO_NUMBER = (ArithmeticError, ValueError)


@dataclass(frozen=True)
class Trace:
    """Motion at the knots; `low` and `high` are the lag's extremes between them (m).

    The electrical columns (currents over I, volts, newtons) are None where nobody wants
    them, and for the nominal drive, where they follow from the positions.
    """

    position: Floats
    velocity: Floats
    low: Floats
    high: Floats
    electrical: Floats | None = None


@dataclass(frozen=True)
class Stepping:
    """Limits of an integration step: time (s), and travel of the axis or the command (m).

    Between ripples of the force the motion is smooth, so at low speed steps may be long. Currents
    behind a lag, whose setpoints are parabolas in a step, go half as far.
    """

    max_s: float
    max_m: float = math.inf


class Integration:
    """Integrates the motion of one axis; `x` and `v` are its present state (m, m/s).

    The axis starts where it has come to rest under its forces. A nominal one, without
    effects and at full current, tells nothing of its currents. The kernel is compiled once it
    has made `compile_after` steps, 0 for at once: compiled or not, it gives the same bits.
    """

    def __init__(
        self,
        plant: PlantConstants,
        command: CommandTable,
        resolved: bool,
        stepping: Stepping,
        active: Sequence[Active],
        scaling: DriveScaling,
        compile_after: float,
    ) -> None:
        self._plant = plant
        self._command = command
        self._resolved = resolved
        self._scaling = scaling
        terms = TermSet.of(active)
        self._numbers = terms.numbers(active)
        lagging = terms.lag is not None and self._numbers[terms.lag][0] > 0
        self._stepping = replace(stepping, max_m=stepping.max_m / 2) if lagging else stepping
        self._nominal = is_nominal(terms, scaling)
        self._strengths = _strengths(plant, scaling, terms.direct)
        self._terms = terms
        self._steps = 0
        self.compile_after = compile_after
        self._state = self._at_rest(terms)

    @property
    def x(self) -> float:
        return self._state[0]

    @x.setter
    def x(self, x: float) -> None:
        self._state = (x, *self._state[1:])

    @property
    def v(self) -> float:
        return self._state[1]

    @property
    def courses(self) -> list[Course]:
        """All that drives the axis."""
        return [self._command.course, self._scaling.course]

    def state(self) -> Floats:
        """The present state as numbers of one size.

        Position and velocity over the natural frequency (m), then the states of effects.
        """
        x, v, path, (lagged, coil) = self._state
        plant = self._plant
        natural = math.sqrt(plant.wave_number_1_m * plant.pull_out_m_s2)
        return np.array([x, v / natural, *path, *lagged, *coil])

    def take_over(self, other: Integration) -> None:
        """Begin in the present state of `other`, an integration with the same effects."""
        self._state = other._state

    def through(self, knots: Floats, recorded: bool = True) -> Trace:
        """Integrate over `knots` from the present state, and keep the last one.

        `recorded`: with the electrical columns, which take time of their own.
        A motion that leaves the finite numbers is NaN from there on.
        """
        recorded = recorded and not self._nominal
        arrays = [
            knots,
            self._command.rows_along(knots[:-1]),
            self._command.rows(self._plant.microstep_m),
            self._scaling.rows_along(knots[:-1]),
            self._strengths,
        ]
        motion = np.full((len(knots), 4), math.nan)
        electrical = np.full((len(knots) if recorded else 0, 5), math.nan)
        limits = (self._stepping.max_s, self._stepping.max_m, REST_M)
        scalars = (_plant(self._plant), limits, self._resolved, self._numbers, self._state)
        compiled = self._steps >= self.compile_after
        integrate, steps = kernel(self._terms, self._nominal, compiled), 0
        if compiled:
            steps, self._state = integrate(*arrays, *scalars, motion, electrical)
        else:
            # Plain Python is several times faster on lists.
            lists = motion.tolist(), electrical.tolist()
            try:
                steps, self._state = integrate(*(a.tolist() for a in arrays), *scalars, *lists)
            except _NO_NUMBER:
                self.x = math.nan
            motion, electrical = np.array(lists[0]), np.array(lists[1])
        self._steps += steps
        position, velocity, low, high = motion.T
        return Trace(
            position, velocity, low[1:], high[1:], electrical.T.copy() if recorded else None
        )

    def _at_rest(self, terms: TermSet) -> State:
        """The state of an axis that has rested at command 0.

        Relaxation: the position by what the tooth's stiffness answers to the force left over,
        currents by their own time constants.
        """
        lag_s = 0.0 if terms.lag is None else self._numbers[terms.lag][0]
        state = start_of(terms)
        if self._nominal:
            return state
        plant = self._plant
        stiffness = plant.wave_number_1_m * plant.pull_out_force_N
        state_rates = rates(terms)
        axis, drive = axis_and_drive(_plant(plant), self._strengths[0].tolist())
        smallest = REST_M * REST_M
        for _ in range(_MOST_RELAXATIONS):
            x, v, z, (lagged, coil) = state
            try:
                a, of_lag, of_coil = state_rates(0.0, 0.0, state, axis, drive, self._numbers)
            except _NO_NUMBER:
                return math.nan, v, z, (lagged, coil)
            step = a * plant.mass_kg / stiffness
            changes = [d * lag_s for d in of_lag], [d * CURRENT_LOOP_S for d in of_coil]
            lagged = tuple(i + d for i, d in zip(lagged, changes[0], strict=False))
            coil = tuple(i + d for i, d in zip(coil, changes[1], strict=False))
            state = (x + step, v, z, (lagged, coil))
            # Without a force the currents may still be on their way: they move the axis next.
            turn_m = max(map(abs, chain(*changes))) / plant.wave_number_1_m
            if max(abs(step), turn_m) < smallest or not math.isfinite(x + step):
                break
        return state


def is_nominal(terms: TermSet, scaling: DriveScaling) -> bool:
    """True for the nominal equation of motion without effects."""
    return not terms.effects and scaling.always_full


def _plant(plant: PlantConstants) -> Plant:
    return (
        plant.wave_number_1_m, plant.pull_out_force_N, plant.damping_N_s_m, plant.mass_kg,
        plant.microstep_m, plant.phase_current_A, plant.coil_resistance_ohm,
        plant.coil_inductance_H,
    )  # fmt: skip


def _strengths(plant: PlantConstants, scaling: DriveScaling, direct: bool) -> Floats:
    """A row for each of the factors: gain, motor force and damping over m, force constant.

    In 1, m/s², 1/s and N/A. direct: whether the gain is in the motor's force rather than in
    the currents. A drive that is switched off damps nothing.
    """
    force_N = plant.pull_out_force_N * scaling.constant
    damping = np.where(scaling.gain > 0.0, plant.damping_N_s_m, 0.0)
    motor_N = force_N * scaling.gain if direct else force_N
    columns = [
        scaling.gain, motor_N / plant.mass_kg, damping / plant.mass_kg,
        force_N / plant.phase_current_A,
    ]  # fmt: skip
    return np.array(columns).T.copy()
