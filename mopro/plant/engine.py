"""What moves one axis: the nominal kernel, or one assembled for the effects switched on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from mopro.effects import Active
from mopro.machine.constants import PlantConstants
from mopro.plant.assembly import CURRENT_LOOP_S, AssembledKernel, Layout, assemble
from mopro.plant.command_table import CommandTable, Floats
from mopro.plant.drive_scaling import DriveScaling

# An axis this close to its tooth, and as slow, is taken to rest where it is. What it would
# still have rung stays within a nanometre of that.
REST_M = 4e-10
_MOST_RELAXATIONS = 400

Integrate = Callable[..., int]


@dataclass(frozen=True)
class Trace:
    """Motion at the knots; `low` and `high` are the lag's extremes between them (m).

    The electrical columns (currents over I, volts, newtons) are None for the nominal
    drive, where they follow from the positions.
    """

    position: Floats
    velocity: Floats
    low: Floats
    high: Floats
    electrical: Floats | None = None


@dataclass(frozen=True)
class Stepping:
    """How far one integration step may go: in time (s), and in the distance that axis or command
    goes (m).

    Between ripples of the force the motion is smooth, so at low speed steps may be long.
    """

    max_s: float
    max_m: float = math.inf


class Engine(Protocol):
    """Takes one axis through time; `x` and `v` are its state now (m, m/s)."""

    x: float
    v: float

    def through(self, knots: Floats) -> Trace:
        """Integrate over `knots` from the present state, and keep the last one."""
        ...

    def take_over(self, other: Self) -> None:
        """Begin in the present state of `other`, an engine for the same effects."""
        ...


class NominalEngine:
    """The equation of motion without effects."""

    def __init__(
        self,
        plant: PlantConstants,
        command: CommandTable,
        resolved: bool,
        stepping: Stepping,
        integrate: Integrate,
        compiled: bool,
    ) -> None:
        self.x = 0.0
        self.v = 0.0
        self._plant = plant
        self._command = command
        self._resolved = resolved
        self._stepping = stepping
        self._integrate = integrate
        self._compiled = compiled

    def take_over(self, other: Self) -> None:
        self.x, self.v = other.x, other.v

    def through(self, knots: Floats) -> Trace:
        plant = self._plant
        outputs = np.zeros((4, len(knots)))
        outputs[0, 0], outputs[1, 0] = self.x, self.v
        inputs = [knots, self._command.rows_at(knots[:-1]), *self._command.coefficients]
        results = _call(
            self._integrate,
            self._compiled,
            inputs,
            [
                plant.wave_number_1_m,
                plant.pull_out_m_s2,
                plant.damping_1_s,
                plant.microstep_m,
                self._resolved,
                self._stepping.max_s,
                self._stepping.max_m,
                REST_M,
            ],
            list(outputs),
        )
        position, velocity, low, high = results
        self.x, self.v = float(position[-1]), float(velocity[-1])
        return Trace(position, velocity, low[:-1], high[:-1])


class AssembledEngine:
    """The equation of motion with the terms of the effects switched on.

    The axis starts where it has come to rest under them.
    """

    def __init__(
        self,
        plant: PlantConstants,
        command: CommandTable,
        resolved: bool,
        stepping: Stepping,
        active: Sequence[Active],
        scaling: DriveScaling,
        compiled: bool,
    ) -> None:
        self._plant = plant
        self._command = command
        self._resolved = resolved
        self._stepping = stepping
        layout = Layout.of(active)
        self._kernel = assemble(layout, compiled)
        terms = set(layout.effects)
        self._numbers = [v for a in active if a.effect in terms for v in a.values]
        self._scaling = scaling
        self.x, self._memory = _at_rest(self._kernel, plant, self._numbers, scaling)
        self.v = 0.0

    def take_over(self, other: Self) -> None:
        self.x, self.v, self._memory = other.x, other.v, list(other._memory)

    def through(self, knots: Floats) -> Trace:
        plant = self._plant
        gain, constant = self._scaling.at(knots[:-1])
        inputs = [knots, self._command.rows_at(knots[:-1]), *self._command.coefficients]
        outputs = np.zeros((9, len(knots)))
        outputs[0, 0], outputs[1, 0] = self.x, self.v
        scalars: list[float] = [
            *_drive_numbers(plant),
            plant.damping_N_s_m,
            plant.mass_kg,
            plant.microstep_m,
            self._resolved,
            self._stepping.max_s,
            self._stepping.max_m,
            REST_M,
        ]
        memory = np.array(self._memory, dtype=np.float64)
        results = _call(
            self._kernel.integrate,
            self._kernel.compiled,
            [*inputs, gain, constant],
            scalars,
            [np.array(self._numbers, dtype=np.float64), memory, *outputs],
        )
        self._memory = results[1].tolist()
        position, velocity, low, high, *electrical = results[2:]
        self.x, self.v = float(position[-1]), float(velocity[-1])
        return Trace(position, velocity, low[:-1], high[:-1], np.array(electrical))


def _call(
    integrate: Integrate,
    compiled: bool,
    arrays: Sequence[Floats],
    scalars: Sequence[float],
    results: Sequence[Floats],
) -> list[Floats]:
    """Run the kernel; as plain Python it is several times faster on lists."""
    if compiled:
        integrate(*arrays, *scalars, *results)
        return list(results)
    lists = [result.tolist() for result in results]
    integrate(*(array.tolist() for array in arrays), *scalars, *lists)
    return [np.asarray(result, dtype=np.float64) for result in lists]


def _drive_numbers(plant: PlantConstants) -> list[float]:
    return [
        plant.wave_number_1_m,
        plant.pull_out_force_N,
        plant.phase_current_A,
        plant.coil_resistance_ohm,
        plant.coil_inductance_H,
    ]


def _at_rest(
    kernel: AssembledKernel, plant: PlantConstants, numbers: list[float], scaling: DriveScaling
) -> tuple[float, list[float]]:
    """Position and states of an axis that has stood at command 0 for long.

    Relaxation: the position by what the tooth's stiffness answers to the force left over,
    currents by their own time constants.
    """
    layout = kernel.layout
    stiffness = plant.wave_number_1_m * plant.pull_out_force_N
    loop_s = {"l": 1.0, "j": CURRENT_LOOP_S}
    if layout.lag is not None:
        before = sum(len(e.parameters) for e in layout.effects[: layout.lag])
        loop_s["l"] = numbers[before]
    x, states = 0.0, [1.0 if s in ("la", "ja") else 0.0 for s in layout.states]
    gain, constant = float(scaling.gain[0]), float(scaling.constant[0])
    for _ in range(_MOST_RELAXATIONS):
        a, *rates = kernel.rates(
            0.0, 0.0, x, 0.0, *states, gain, constant, *_drive_numbers(plant),
            plant.damping_N_s_m, plant.mass_kg, *numbers,
        )  # fmt: skip
        step = a * plant.mass_kg / stiffness
        x += step
        for i, name in enumerate(layout.in_time):
            states[i] += rates[i] * loop_s.get(name[0], 0.0)
        if abs(step) < REST_M * REST_M or not math.isfinite(x):
            break
    return x, states
