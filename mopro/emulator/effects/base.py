"""What an effect is: one object that the emulator runs, a machine file switches on and a
diagnosis fits.

An effect overrides the hooks of its stage and leaves the others alone. Parameters reach
every hook in their order, in the unit that they state (SI throughout).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mopro.emulator.plant import PlantNumbers
    from mopro.machine import Machine
    from mopro.motion import PlannedMove, Schedule
    from mopro.program import Program

Floats = NDArray[np.float64]
# A term of the equation of motion: scalars in, scalars out, in the Python numba compiles.
Term = Callable[..., Any]


class Stage(StrEnum):
    """Where an effect acts: on the command, the dynamics, the measurement, the heat."""

    COMMAND = "C"
    DYNAMICS = "D"
    MEASUREMENT = "M"
    HEAT = "T"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    `low` and `high` are the bounds of what makes sense at all, `plausible` the range to
    expect, `null` the value at which the effect vanishes, `default` one to try.
    `dimension` is the units.py dimension that a machine file may convert from.
    """

    name: str
    unit: str
    dimension: str
    default: float
    plausible: tuple[float, float]
    low: float
    high: float
    meaning: str
    null: float = 0.0
    whole: bool = False

    def fault(self, value: float) -> str | None:
        """What is wrong with `value`, if anything."""
        if not math.isfinite(value) or not self.low <= value <= self.high:
            bounds = f"{self.low:g} to {self.high:g} {self.unit}"
            return f"{self.name} = {value:g} is out of bounds: expected {bounds}"
        if self.whole and value != round(value):
            return f"{self.name} = {value:g} must be a whole number"
        return None


@dataclass
class Surroundings:
    """The forcer's heat balance at one moment; effects of the heat stage change it.

    `coil_W` is put into the coils, `conductance_W_K` leads to air of `air_C`,
    `speeds_m_s` are the axes' speeds, `lengths_m` their strokes, `extra_W` whatever
    else comes in.
    """

    time_s: float
    temperature_C: float
    air_C: float
    coil_W: float
    conductance_W_K: float
    speeds_m_s: tuple[float, ...]
    lengths_m: tuple[float, ...]
    machine: Machine
    extra_W: float = 0.0

    @property
    def flow_W(self) -> float:
        """The net heat flow into the forcer."""
        loss = self.conductance_W_K * (self.temperature_C - self.air_C)
        return self.coil_W + self.extra_W - loss


@dataclass(frozen=True)
class Scene:
    """What surrounds a measurement: samples of the true run on one axis and its other."""

    time_s: Floats
    other_m: Floats
    temperature_C: Floats
    air_C: float


class Effect:
    """Base of all effects; the subclass' docstring states equation, units and source."""

    name: ClassVar[str]
    stage: ClassVar[Stage]
    parameters: ClassVar[tuple[Parameter, ...]]
    families: ClassVar[tuple[str, ...]] = ()
    # Terms of the equation of motion, composed into the kernel (see plant/kernel/terms.py);
    # z is the effect's own state if it has a `slide`:
    #   force(x, v, [z,] *parameters) -> N              a force on the forcer
    #   reaction(x, v, [z,] motor_N, *parameters) -> N  one that depends on the motor's own
    #   slide(z, dx, *parameters) -> z                  a state that follows the path
    #   setpoint(theta, ia, ib, *parameters) -> (ia, ib)   phase currents over I
    force: ClassVar[Term | None] = None
    reaction: ClassVar[Term | None] = None
    slide: ClassVar[Term | None] = None
    setpoint: ClassVar[Term | None] = None
    # Blocks that the drive itself knows: "lag" or "voltage".
    current_loop: ClassVar[str | None] = None

    # An effect has no state: two objects of one class are one effect, and one kernel.
    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def parameter(self, name: str) -> Parameter:
        """Its parameter of that name; KeyError if it has none."""
        return {p.name: p for p in self.parameters}[name]

    def equation(self) -> str:
        """The docstring: what the effect is, its equation, units and source."""
        return inspect.getdoc(type(self)) or ""

    def neutral(self, machine: Machine) -> dict[str, float]:
        """The values at which the effect vanishes on `machine`."""
        return {p.name: p.null for p in self.parameters}

    # -- hooks: command ---------------------------------------------------------

    def program(self, program: Program, *p: float) -> Program:
        """The program as the controller takes it."""
        return program

    def schedule(self, schedule: Schedule, *p: float) -> Schedule:
        """The schedule as the controller keeps it."""
        return schedule

    def tick_s(self, *p: float) -> tuple[float, bool]:
        """The controller's update interval, and whether it interpolates; 0 for none."""
        return 0.0, False

    # -- hooks: dynamics --------------------------------------------------------

    def plant(self, plant: PlantNumbers, *p: float) -> PlantNumbers:
        """The constants of the equation of motion."""
        return plant

    def force_factor(self, temperature_C: Floats, *p: float) -> Floats | None:
        """The factor on the force constant at these temperatures."""
        return None

    def hold(self, *p: float) -> tuple[float, float] | None:
        """(time at rest in s, factor on the current from then on)."""
        return None

    def jumps(self, moves: list[PlannedMove], *p: float) -> list[tuple[float, float]]:
        """(time, pitches) at which the axis falls behind at once, for the axis' moves."""
        return []

    # -- hooks: heat ------------------------------------------------------------

    def heat(self, here: Surroundings, *p: float) -> None:
        """Change the heat balance in place."""

    # -- hooks: measurement -----------------------------------------------------

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        """When the sample labelled `time_s` is really taken."""
        return time_s

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """Where the sensor's target is when the axis is at `x` (m)."""
        return x

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        """What the transducer makes of its target at `x` (m)."""
        return x

    def bandwidth_s(self, quantity: str, *p: float) -> float:
        """The time constant of a first-order lag of a sensor of `quantity`."""
        return 0.0

    def electronics(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        """What is added after the transducer, at the times of sampling."""
        return x

    @property
    def distorts(self) -> bool:
        """Whether it changes what is read of the target, and not only when."""
        own = type(self)
        return own.reading is not Effect.reading or own.electronics is not Effect.electronics


@dataclass(frozen=True)
class Active:
    """An effect switched on with these values, on these axes."""

    effect: Effect
    values: tuple[float, ...]
    axes: tuple[int, ...]

    @property
    def name(self) -> str:
        return self.effect.name

    def as_json(self) -> dict[str, object]:
        numbers = {p.name: v for p, v in zip(self.effect.parameters, self.values, strict=True)}
        return {"name": self.name, "axes": list(self.axes), "parameters": numbers}


def on_axis(active: tuple[Active, ...], axis: int) -> tuple[Active, ...]:
    """Those of `active` that act on `axis`."""
    return tuple(a for a in active if axis in a.axes)
